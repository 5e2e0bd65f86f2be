// Small charts, and the error of the run over time.
// Axes of a small chart; gives back where a value lies.
function drawFrame(context, frame, label) {
  const [xLow, xHigh] = frame.x;
  const pad = 0.06 * (frame.y[1] - frame.y[0] || 1);
  const [yLow, yHigh] = [frame.y[0] - (frame.y[0] === 0 ? 0 : pad), frame.y[1] + pad];
  const x = (value) => frame.left + ((value - xLow) / (xHigh - xLow || 1)) * (frame.right - frame.left);
  const y = (value) => frame.bottom - ((value - yLow) / (yHigh - yLow)) * (frame.bottom - frame.top);
  context.strokeStyle = colours.line;
  context.fillStyle = colours.grey;
  context.lineWidth = 1;
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticks(yLow, yHigh, 3)) {
    line(context, frame.left, y(tick), frame.right, y(tick));
    context.fillText(minus(String(+tick.toPrecision(4))), frame.left - 4, y(tick));
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const tick of ticks(xLow, xHigh, 4)) context.fillText(minus(String(+tick.toPrecision(5))), x(tick), frame.bottom + 3);
  context.fillText(label, (frame.left + frame.right) / 2, frame.bottom + 18);
  return { x, y };
}

// Of the run that is shown in ink, and of those beside it in the shades of their captions.
function drawErrors(canvas, run, step, others) {
  const { context, width, height } = prepared(canvas);
  if (width < 150) return; // not laid out yet
  const total = run.ospa.map((parts) => parts[0]);
  const frame = {
    left: 40, right: width - 10, top: 8, bottom: height - 34,
    x: [run.times[0], run.times.at(-1)],
    y: [0, Math.max(...total, ...others.flatMap((other) => other.run.ospa.map(([value]) => value)), 1)],
  };
  const { x, y } = drawFrame(context, frame, "time (s)");
  context.setLineDash([2, 3]);
  context.strokeStyle = colours.grey;
  for (const { scan } of run.decisions) line(context, x(run.times[scan]), frame.top, x(run.times[scan]), frame.bottom);
  context.setLineDash([]);
  const curve = ({ times, ospa }, shade, width) => {
    context.strokeStyle = shade;
    context.lineWidth = width;
    context.beginPath();
    ospa.forEach(([value], k) => context.lineTo(x(times[k]), y(value)));
    context.stroke();
  };
  others.forEach((other) => curve(other.run, colours[other.shade], 1.2));
  curve(run, colours.ink, 1.6);
  context.fillStyle = colours.ink;
  disc(context, x(run.times[step]), y(total[step]), 4);
}
