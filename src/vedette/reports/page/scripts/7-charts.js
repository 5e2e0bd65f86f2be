// Axes of a small chart; gives back where a value lies.
function drawFrame(context, frame, label, words = null) {
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
  for (const tick of ticks(xLow, xHigh, Math.max(3, (frame.right - frame.left) / 110))) {
    context.fillText(words ? words(tick) : minus(String(+tick.toPrecision(5))), x(tick), frame.bottom + 7);
  }
  context.fillText(label, (frame.left + frame.right) / 2, frame.bottom + 21);
  return { x, y };
}

