// Below the timeline: the heights of estimates over time, of targets in grey, and the scan that is shown.
function drawHeights(canvas, run, step) {
  const { context, width, height } = prepared(canvas);
  if (width < 150) return; // not laid out yet
  const all = [...run.heights.estimates.flat().map(([value]) => value), ...run.heights.truth.flat()];
  const frame = { ...timelineFrame(width, height, [run]), y: [0, Math.max(100, ...all)] };
  const { x, y } = drawFrame(context, frame, run.utc === null ? "time (s)" : "time (UTC)", run.utc === null ? null : (time) => clockTime(run, time));
  drawSide(context, frame, "height (m)");
  drawPaths(context, run, (scan) => run.truth[scan].map(([target], place) => [target, run.heights.truth[scan][place]]), x, y, () => colours.grey, 1);
  const ofEstimate = (scan) => run.estimates[scan].map(([label], place) => [label, run.heights.estimates[scan][place][0]]);
  drawPaths(context, run, ofEstimate, x, y, (label) => seriesColour(placeOfLabel(run, label)), 1.8);
  if (run.times[step] == null) return;
  context.strokeStyle = colours.link;
  context.lineWidth = 1.5;
  line(context, x(run.times[step]), 2, x(run.times[step]), frame.bottom);
}

// One line a name; it ends where the name is missing at a scan.
function drawPaths(context, run, at, x, y, shade, thickness) {
  context.lineWidth = thickness;
  let open = new Map(); // name -> its last point
  run.times.forEach((time, scan) => {
    const next = new Map();
    for (const [name, value] of time === null ? [] : at(scan)) {
      if (value === undefined) continue;
      const [px, py] = [x(time), y(value)];
      context.strokeStyle = shade(name);
      if (open.has(name)) line(context, ...open.get(name), px, py);
      else line(context, px - 1, py, px + 1, py);
      next.set(name, [px, py]);
    }
    open = next;
  });
}
