// One scan of a run in the plane.
const HOLE = "hole of a no-go zone";
const UNKNOWN = -1; // what is behind a measurement that was recorded
const clipped = (name, most) => (name.length > most ? `${name.slice(0, most - 1)}\u2026` : name);
function drawScene(canvas, run, step, show, camera, ghost) {
  const { context, width, height } = prepared(canvas);
  const view = viewOf(run, width, height, camera);
  if (view.scale <= 0) return view; // not laid out yet
  drawAxes(context, run, view, width, height);
  context.save();
  context.beginPath();
  context.rect(MARGIN.left, MARGIN.top, view.inner.width, view.inner.height);
  context.clip();
  if (show.undetected) drawUndetected(context, view, decisionAt(run, step)?.undetected);
  drawZones(context, run, view);
  if (show.measurements) run.sensors.forEach((_, s) => drawMeasurements(context, run, view, step, s));
  if (show.trails) drawTrails(context, run, view, step, show);
  if (ghost) drawGhost(context, ghost, view, Math.min(step, ghost.times.length - 1));
  run.sensors.forEach((_, s) => drawSensor(context, run, view, step, s));
  const tracked = trackedAt(run, step);
  run.truth[step].forEach((target) => drawTarget(context, view, target, tracked.has(target[0])));
  run.estimates[step].forEach((_, place) => drawEstimate(context, run, view, step, place, show));
  drawScale(context, view);
  if (show.labels) drawNames(context, run, view, step, show);
  context.restore();
  return view;
}

// Where undetected targets were expected at the last decision: the darker, the more of them in a cell.
function drawUndetected(context, view, cells) {
  if (!cells) return;
  const { columns, rows, shares } = cells;
  const [west, east, south, north] = cells.extent;
  const x = (column) => view.x(west + ((east - west) * column) / columns);
  const y = (row) => view.y(south + ((north - south) * row) / rows);
  context.fillStyle = colours.sky;
  shares.forEach((share, cell) => {
    if (!share) return;
    const [column, row] = [cell % columns, Math.floor(cell / columns)];
    context.globalAlpha = 0.6 * (share / 100);
    context.fillRect(x(column), y(row + 1), x(column + 1) - x(column) + 0.5, y(row) - y(row + 1) + 0.5);
  });
  context.globalAlpha = 1;
}

// Another run with the same luck, hollow: where its sensors are and went (squares), and its estimates (diamonds).
function drawGhost(context, run, view, step) {
  context.strokeStyle = colours.ink;
  context.lineWidth = 1.2;
  context.globalAlpha = 0.8;
  context.setLineDash([1, 3]);
  run.sensors.forEach((_, s) => polyline(context, view, run.poses.slice(0, step + 1).map((poses) => poses[s])));
  context.setLineDash([]);
  for (const [x, y] of run.poses[step]) context.strokeRect(view.x(x) - 6.5, view.y(y) - 6.5, 13, 13);
  for (const [, x, y] of run.estimates[step]) {
    const [px, py] = [view.x(x), view.y(y)];
    context.beginPath();
    [[0, -7], [7, 0], [0, 7], [-7, 0]].forEach(([dx, dy]) => context.lineTo(px + dx, py + dy));
    context.closePath();
    context.stroke();
  }
  context.globalAlpha = 1;
}

// The region, and where sensors may not go (hatched) or must stay.
function drawZones(context, run, view) {
  run.zones.forEach(([kind, corners], place) => {
    if (kind === HOLE) return; // drawn with its zone
    if (kind === "coastline") {
      context.lineWidth = 1;
      context.strokeStyle = colours.grey;
      polyline(context, view, corners);
      return;
    }
    const rest = run.zones.slice(place + 1);
    const holes = rest.slice(0, rest.findIndex(([other]) => other !== HOLE) >>> 0).map(([, hole]) => hole);
    context.lineWidth = 1;
    context.strokeStyle = kind === "region" ? colours.grey : colours.ink;
    context.setLineDash({ region: [5, 4], "no-go zone": [] }[kind] ?? [8, 3, 2, 3]);
    polygons(context, view, [corners, ...holes]);
    context.stroke();
    context.setLineDash([]);
    if (kind === "no-go zone") hatch(context, view);
  });
}

function polygons(context, view, rings) {
  context.beginPath();
  for (const ring of rings) {
    ring.forEach(([x, y], place) => (place ? context.lineTo(view.x(x), view.y(y)) : context.moveTo(view.x(x), view.y(y))));
    context.closePath();
  }
}

// Fill the polygons that were just drawn, but for their holes, with slanted lines.
function hatch(context, view) {
  const { width, height } = view.inner;
  context.save();
  context.clip("evenodd");
  context.strokeStyle = colours.grey;
  for (let x = -height; x < width; x += 8) {
    line(context, MARGIN.left + x, MARGIN.top + height, MARGIN.left + x + height, MARGIN.top);
  }
  context.restore();
}

function drawTrails(context, run, view, step, show) {
  context.lineWidth = 1.2;
  context.strokeStyle = colours.ink;
  const paths = new Map();
  for (let scan = 0; scan <= step; scan += 1) {
    for (const [target, x, y] of run.truth[scan]) {
      if (!paths.has(target)) paths.set(target, []);
      paths.get(target).push([x, y]);
    }
  }
  for (const path of paths.values()) polyline(context, view, path);
  for (let scan = 0; scan <= step; scan += 1) {
    for (const [place, estimate] of run.estimates[scan].entries()) {
      context.fillStyle = estimateShade(run, scan, place, show);
      context.globalAlpha = 0.55;
      disc(context, view.x(estimate[1]), view.y(estimate[2]), 1.6);
    }
  }
  context.globalAlpha = 1;
  context.strokeStyle = colours.grey;
  context.lineWidth = 2;
  context.setLineDash([6, 3]);
  run.sensors.forEach((_, s) => polyline(context, view, run.poses.slice(0, step + 1).map((poses) => poses[s])));
  context.setLineDash([]);
}

function polyline(context, view, path) {
  context.beginPath();
  path.forEach(([x, y], place) => (place ? context.lineTo(view.x(x), view.y(y)) : context.moveTo(view.x(x), view.y(y))));
  context.stroke();
}

function disc(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function drawMeasurements(context, run, view, step, s) {
  const [x, y] = run.poses[step][s];
  const kind = run.sensors[s].kind;
  for (const [origin, u, v] of (run.scans[step] ?? [])[s] ?? []) {
    const weight = origin === UNKNOWN ? 0.5 : origin ? 1 : 0;
    context.strokeStyle = origin ? colours.ink : colours.grey;
    context.globalAlpha = 0.6 + 0.35 * weight;
    context.lineWidth = 1 + 0.6 * weight;
    if (kind === "ray") {
      const reach = 2 * extentOf(run) * view.scale;
      line(context, view.x(x), view.y(y), view.x(x) + reach * Math.cos(u), view.y(y) - reach * Math.sin(u));
    } else if (kind === "circle") {
      context.beginPath();
      context.arc(view.x(x), view.y(y), Math.max(u, 0) * view.scale, 0, 2 * Math.PI);
      context.stroke();
    } else if (kind !== "none") {
      const size = 2.5 + 1.5 * weight;
      line(context, view.x(u) - size, view.y(v) - size, view.x(u) + size, view.y(v) + size);
      line(context, view.x(u) - size, view.y(v) + size, view.x(u) + size, view.y(v) - size);
    }
  }
  context.globalAlpha = 1;
}

function drawSensor(context, run, view, step, s) {
  const seen = run.sensors[s];
  // A camera's field of view goes with its pose.
  const [x, y, heading, middle = heading, halfWidth = seen.half_width, range = seen.range] = run.poses[step][s];
  const [px, py] = [view.x(x), view.y(y)];
  if (range !== undefined) {
    context.fillStyle = colours.grey;
    context.globalAlpha = 0.1;
    context.beginPath();
    if (halfWidth !== undefined && halfWidth < Math.PI) context.moveTo(px, py);
    const spread = halfWidth ?? Math.PI;
    context.arc(px, py, range * view.scale, -middle - spread, -middle + spread);
    context.fill();
    context.globalAlpha = 1;
  }
  context.strokeStyle = colours.ink;
  context.fillStyle = colours.grey;
  context.lineWidth = 1.5;
  if (heading !== seen.unturned) {
    const [tipX, tipY] = [px + 20 * Math.cos(heading), py - 20 * Math.sin(heading)];
    line(context, px, py, tipX, tipY);
    for (const side of [2.6, -2.6]) {
      line(context, tipX, tipY, tipX + 6 * Math.cos(heading + side), tipY - 6 * Math.sin(heading + side));
    }
  }
  context.fillRect(px - 5.5, py - 5.5, 11, 11);
  context.strokeRect(px - 5.5, py - 5.5, 11, 11);
}

// A target without an estimate is a red ring.
function drawTarget(context, view, [, x, y], isTracked) {
  context.strokeStyle = isTracked ? colours.ink : colours.bad;
  context.fillStyle = colours.paper;
  context.lineWidth = isTracked ? 1.6 : 3;
  disc(context, view.x(x), view.y(y), isTracked ? 4 : 7);
  context.stroke();
}

// By label, or by mode of motion; beside another run in the colour of the strategy.
function estimateShade(run, step, place, show) {
  if (show.shade) return colours[show.shade];
  if (!show.modes || !run.modes) return seriesColour(placeOfLabel(run, run.estimates[step][place][0]));
  const mode = run.modes[step][place];
  return mode < 0 ? colours.grey : seriesColour(mode);
}

function drawEstimate(context, run, view, step, place, show) {
  const [, x, y, , long, short, angle] = run.estimates[step][place];
  const shade = estimateShade(run, step, place, show);
  context.strokeStyle = shade;
  context.fillStyle = shade;
  context.lineWidth = 1.4;
  if (show.ellipses) {
    context.beginPath();
    context.ellipse(view.x(x), view.y(y), long * view.scale, short * view.scale, -angle, 0, 2 * Math.PI);
    context.globalAlpha = 0.18;
    context.fill();
    context.globalAlpha = 1;
    context.stroke();
  }
  disc(context, view.x(x), view.y(y), 3);
}

// Text that stays legible over whatever is behind it.
function mark(context, text, x, y, shade) {
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 3;
  context.strokeStyle = colours.paper;
  context.strokeText(text, x, y);
  context.fillStyle = shade;
  context.fillText(text, x, y);
}
