// Beside the plane: the rewards of the last decision, and what lies under the pointer there.
function drawRewards(canvas, decision, run) {
  const { context, width, height } = prepared(canvas);
  if (width < 150) return; // not laid out yet
  if (!decision?.curves.length) return;
  const names = run.sensors.map(({ name }) => clipped(name, 16));
  if (decision.map) drawMap(context, width, height, decision.map, names);
  else drawCurves(context, width, height, decision.curves, names);
}

// Where a square map lies in its canvas, with room for its ticks.
function mapFrame(width, height, map) {
  const longest = Math.max(...map.ticks[1].map((text) => text.length));
  const [left, top] = [Math.min(24 + 7 * longest, width / 3), 8];
  const size = Math.min(width - left - 56, height - top - 40);
  return { left, top, size, columns: map.mean.length, rows: map.mean[0].length };
}

function drawMap(context, width, height, map, names) {
  const { left, top, size, columns, rows } = mapFrame(width, height, map);
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
  labelMap(context, map, left, top, size, names);
}

function drawHeatScale(context, x, top, size, low, high) {
  for (let k = 0; k < 40; k += 1) {
    context.fillStyle = heatColour(1 - k / 39);
    context.fillRect(x, top + (k * size) / 40, 8, size / 40 + 0.5);
  }
  context.fillStyle = colours.grey;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(short(high), x + 11, top + 6);
  context.fillText(short(low), x + 11, top + size - 6);
}

function labelMap(context, map, left, top, size, names) {
  const [across, up] = map.ticks;
  context.fillStyle = colours.grey;
  const place = (list, k) => ((k + 0.5) * size) / list.length;
  for (const k of [0, Math.floor(across.length / 2), across.length - 1]) {
    context.textAlign = "center";
    context.textBaseline = "top";
    context.fillText(across[k], left + place(across, k), top + size + 3);
  }
  for (const k of [0, Math.floor(up.length / 2), up.length - 1]) {
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillText(up[k], left - 4, top + size - place(up, k));
  }
  context.textAlign = "center";
  context.textBaseline = "top";
  context.fillText(names[map.sensors[0]], left + size / 2, top + size + 18);
  context.save();
  context.translate(8, top + size / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "middle";
  context.fillText(names[map.sensors[1]], 0, 0);
  context.restore();
}

// Curves along other axes than the first one's count their actions.
const placesOf = (curves, curve) =>
  (curves.every(({ axis, numeric }) => numeric && axis === curves[0].axis) ? curve.places : curve.labels.map((_, k) => k + 1));

// Where the curves lie in their canvas.
function curvesFrame(width, height, curves) {
  const all = curves.flatMap((curve) => curve.mean).filter((value) => value !== null);
  const places = curves.flatMap((curve) => placesOf(curves, curve));
  return {
    left: 40, right: width - 10, top: 22, bottom: height - 34,
    x: [Math.min(...places), Math.max(...places)], y: [Math.min(...all), Math.max(...all)],
  };
}

function drawCurves(context, width, height, curves, names) {
  const frame = curvesFrame(width, height, curves);
  const { x, y } = drawFrame(context, frame, placesOf(curves, curves[0]) === curves[0].places ? curves[0].axis.toLowerCase() : "action");
  curves.forEach((curve, place) => {
    const shade = colours[sensorShade(curve.sensor)];
    const places = placesOf(curves, curve);
    context.strokeStyle = shade;
    context.lineWidth = 1.6;
    context.beginPath();
    curve.mean.forEach((value, k) => value !== null && context.lineTo(x(places[k]), y(value)));
    context.stroke();
    context.fillStyle = shade;
    disc(context, x(places[curve.chosen]), y(curve.mean[curve.chosen]), 4.5);
    if (curves.length > 2) return; // no room for their names; the pointer tells them
    context.textAlign = "left";
    context.textBaseline = "middle";
    const name = `${names[curve.sensor]}: ${minus((curve.numeric ? curve.labels : curve.ticks)[curve.chosen])}`;
    context.fillText(name, frame.left + place * 140, 9);
  });
}

const rewardText = (value) => (value === null ? "not evaluated" : `reward ${minus(value.toPrecision(4))}`);
const actionText = (name, label) => `${name} to ${minus(label)}`;

// The reward under the pointer, in words; nothing beside the map or the curves.
function describeReward(canvas, run, decision, x, y) {
  if (!decision?.curves.length) return [];
  const names = run.sensors.map(({ name }) => name);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  return decision.map ? describeCell(mapFrame(width, height, decision.map), decision.map, names, x, y)
    : describeAction(curvesFrame(width, height, decision.curves), decision.curves, names, x);
}

function describeCell({ left, top, size, columns, rows }, map, names, x, y) {
  const i = Math.floor(((x - left) / size) * columns);
  const j = rows - 1 - Math.floor(((y - top) / size) * rows);
  if (i < 0 || j < 0 || i >= columns || j >= rows) return [];
  const joint = map.sensors.map((sensor, axis) => actionText(names[sensor], map.labels[axis][axis ? j : i])).join(", ");
  const chosen = i === map.chosen[0] && j === map.chosen[1] ? " (chosen)" : "";
  return [`${joint}: ${rewardText(map.mean[i][j])}${chosen}`];
}

function describeAction(frame, curves, names, x) {
  const share = (x - frame.left) / (frame.right - frame.left);
  const place = frame.x[0] + share * (frame.x[1] - frame.x[0]);
  if (share < -0.02 || share > 1.02) return [];
  return curves.map((curve) => {
    const off = placesOf(curves, curve).map((each) => Math.abs(each - place));
    const k = off.indexOf(Math.min(...off));
    const error = curve.error[k] ? ` \u00b1 ${curve.error[k].toPrecision(2)}` : "";
    const chosen = k === curve.chosen ? " (chosen)" : "";
    return `${actionText(names[curve.sensor], curve.labels[k])}: ${rewardText(curve.mean[k])}${error}${chosen}`;
  });
}
