// Runs of the same luck beside the one that is shown, each in a plane of its own: one clock, one zoom and pan.
const MOST_BESIDE = 3;

// The last scan of a run at or before a time.
const stepAt = (run, time) => Math.max(0, run.times.findLastIndex((at) => at <= time + 1e-9));

// What can stand beside a run: another one of the same luck, or all of them.
function besides(paired) {
  const found = paired.map(([place, { strategy }]) => [place, clipped(strategy, 30)]);
  const first = found.slice(0, MOST_BESIDE);
  const all = first.length < found.length ? `${first.length} others` : "all";
  return first.length > 1 ? [...found, [first.map(([place]) => place).join(" "), all]] : found;
}

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
    panels = others.map((other, place) => {
      const [box, caption, canvas] = [element("div", "panel"), element("p", "note caption"), element("canvas")];
      canvas.setAttribute("role", "img");
      box.append(caption, canvas);
      holder.append(box);
      const shade = SERIES[place];
      caption.style.borderColor = `var(--${shade})`;
      const panel = { box, caption, canvas, shade, run: { ...other, extent: main.extent }, step: 0, view: null };
      attach(panel);
      return panel;
    });
  }

  function draw(time, options, camera) {
    for (const panel of panels) {
      panel.step = stepAt(panel.run, time);
      panel.view = drawScene(panel.canvas, panel.run, panel.step, options, camera, null);
      panel.caption.textContent = captionOf(panel.run, panel.step);
      panel.canvas.setAttribute("aria-label", panel.caption.textContent);
    }
  }

  return { show, draw, all: () => panels };
}

function captionOf(run, step) {
  const error = run.known ? `, OSPA ${run.ospa[step][0].toFixed(1)}${run.ospa_unit && ` ${run.ospa_unit}`}` : "";
  return `${run.strategy}: ${run.estimates[step].length} estimates${error}`;
}
