// Beside the plane: the rewards of the last decision, and the error over time.
function drawRewards(canvas, run, step) {
  const { context, width, height } = prepared(canvas);
  const decision = decisionAt(run, step);
  if (width < 150) return; // not laid out yet
  if (!decision?.curves.length) return;
  if (decision.map) drawMap(context, width, height, decision.map);
  else drawCurves(context, width, height, decision.curves);
}

function drawMap(context, width, height, map) {
  const [left, top, bottom] = [46, 8, 34];
  const size = Math.min(width - left - 46, height - top - bottom);
  const [columns, rows] = [map.mean.length, map.mean[0].length];
  const known = map.mean.flat().filter((value) => value !== null);
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const cell = { width: size / columns, height: size / rows };
  map.mean.forEach((column, i) => column.forEach((value, j) => {
    if (value === null) return;
    context.fillStyle = heatColour((value - low) / (high - low || 1));
    context.fillRect(left + i * cell.width, top + (rows - 1 - j) * cell.height, cell.width + 0.5, cell.height + 0.5);
  }));
  const [i, j] = map.chosen;
  for (const [shade, lineWidth] of [["black", 4], ["white", 2]]) {
    context.strokeStyle = shade;
    context.lineWidth = lineWidth;
    context.strokeRect(left + i * cell.width, top + (rows - 1 - j) * cell.height, cell.width, cell.height);
  }
  drawHeatScale(context, left + size + 8, top, size, low, high);
  labelMap(context, map, left, top, size);
}

function drawHeatScale(context, x, top, size, low, high) {
  for (let k = 0; k < 40; k += 1) {
    context.fillStyle = heatColour(1 - k / 39);
    context.fillRect(x, top + (k * size) / 40, 8, size / 40 + 0.5);
  }
  context.fillStyle = colours.grey;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(high.toPrecision(3), x + 11, top + 6);
  context.fillText(low.toPrecision(3), x + 11, top + size - 6);
}

function labelMap(context, map, left, top, size) {
  const [across, up] = map.degrees;
  context.fillStyle = colours.grey;
  const place = (list, k) => ((k + 0.5) * size) / list.length;
  for (const k of [0, Math.floor(across.length / 2), across.length - 1]) {
    context.textAlign = "center";
    context.textBaseline = "top";
    context.fillText(minus(String(Math.round(across[k]))), left + place(across, k), top + size + 3);
  }
  for (const k of [0, Math.floor(up.length / 2), up.length - 1]) {
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillText(minus(String(Math.round(up[k]))), left - 4, top + size - place(up, k));
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  context.fillText(`sensor ${map.sensors[0] + 1} (deg)`, left + size / 2, top + size + 18);
  context.save();
  context.translate(8, top + size / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "middle";
  context.fillText(`sensor ${map.sensors[1] + 1} (deg)`, 0, 0);
  context.restore();
}

function drawCurves(context, width, height, curves) {
  const all = curves.flatMap((curve) => curve.mean).filter((value) => value !== null);
  const headings = curves.flatMap((curve) => curve.degrees);
  const frame = {
    left: 40, right: width - 10, top: 22, bottom: height - 34,
    x: [Math.min(...headings), Math.max(...headings)], y: [Math.min(...all), Math.max(...all)],
  };
  const { x, y } = drawFrame(context, frame, "heading (deg)");
  curves.forEach((curve, place) => {
    const shade = seriesColour(curve.sensor);
    context.strokeStyle = shade;
    context.lineWidth = 1.6;
    context.beginPath();
    curve.mean.forEach((value, k) => value !== null && context.lineTo(x(curve.degrees[k]), y(value)));
    context.stroke();
    context.fillStyle = shade;
    disc(context, x(curve.degrees[curve.chosen]), y(curve.mean[curve.chosen]), 4.5);
    context.textAlign = "left";
    context.textBaseline = "middle";
    const name = `sensor ${curve.sensor + 1}: ${minus(String(Math.round(curve.degrees[curve.chosen])))}\u00b0`;
    context.fillText(name, frame.left + (place % 3) * 100, 9);
  });
}

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

function drawErrors(canvas, run, step) {
  const { context, width, height } = prepared(canvas);
  if (width < 150) return; // not laid out yet
  const total = run.ospa.map((parts) => parts[0]);
  const frame = {
    left: 40, right: width - 10, top: 8, bottom: height - 34,
    x: [run.times[0], run.times.at(-1)], y: [0, Math.max(...total, 1)],
  };
  const { x, y } = drawFrame(context, frame, "time (s)");
  context.setLineDash([2, 3]);
  context.strokeStyle = colours.grey;
  for (const { scan } of run.decisions) line(context, x(run.times[scan]), frame.top, x(run.times[scan]), frame.bottom);
  context.setLineDash([]);
  context.strokeStyle = colours.blue;
  context.lineWidth = 1.6;
  context.beginPath();
  total.forEach((value, k) => context.lineTo(x(run.times[k]), y(value)));
  context.stroke();
  context.fillStyle = colours.vermilion;
  disc(context, x(run.times[step]), y(total[step]), 4);
}
