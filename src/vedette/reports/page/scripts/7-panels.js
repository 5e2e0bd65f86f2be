// Another run of the same targets and noise beside the one that is shown: one clock, one zoom and pan.

// The last scan of a run at or before a time.
const stepAt = (run, time) => Math.max(0, run.times.findLastIndex((at) => at <= time + 1e-9));

// A run in the plane that holds it and others.
function inOnePlane(run, others) {
  const ends = [Math.min, Math.max, Math.min, Math.max];
  const extents = [run, ...others].map(({ extent }) => extent);
  return { ...run, extent: ends.map((end, side) => end(...extents.map((extent) => extent[side]))) };
}

// Panels of runs in the plane of another; `attach` is told each new canvas and what it shows.
function panelsOf(holder, attach) {
  let panels = [];

  function show(main, others) {
    for (const { box } of panels) box.remove();
    panels = others.map((other) => {
      const [box, caption, canvas] = [element("div", "panel"), element("p", "note caption"), element("canvas")];
      canvas.setAttribute("role", "img");
      box.append(caption, canvas);
      holder.append(box);
      const shade = strategyShade(other);
      caption.style.borderColor = `var(--${shade})`;
      const panel = { box, caption, canvas, shade, run: { ...other, extent: main.extent }, step: 0, view: null };
      attach(panel);
      return panel;
    });
  }

  function draw(time, options, camera) {
    for (const panel of panels) {
      panel.step = stepAt(panel.run, time);
      panel.view = drawScene(panel.canvas, panel.run, panel.step, { ...options, shade: panel.shade }, camera, null);
      panel.caption.textContent = captionOf(panel.run, panel.step);
      panel.canvas.setAttribute("aria-label", panel.caption.textContent);
    }
  }

  return { show, draw, all: () => panels };
}

function captionOf(run, step) {
  if (!run.known) return `${run.strategy}: ${run.estimates[step].length} estimates`;
  const tracked = trackedAt(run, step);
  const number = run.truth[step].filter(([target]) => tracked.has(target)).length;
  const error = `OSPA ${run.ospa[step][0].toFixed(1)}${run.ospa_unit && ` ${run.ospa_unit}`}`;
  return `${run.strategy}: ${number} of ${run.truth[step].length} targets tracked, ${error}`;
}
