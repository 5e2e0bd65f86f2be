// Between metres in the plane and pixels on the canvas; axes around it.
const MARGIN = { left: 52, right: 12, top: 10, bottom: 36 };

function viewOf(run, width, height, camera) {
  const [xMin, xMax, yMin, yMax] = run.extent;
  const inner = { width: width - MARGIN.left - MARGIN.right, height: height - MARGIN.top - MARGIN.bottom };
  const scale = 0.96 * camera.zoom * Math.min(inner.width / (xMax - xMin), inner.height / (yMax - yMin));
  const middle = { x: MARGIN.left + inner.width / 2, y: MARGIN.top + inner.height / 2 };
  const [east, north] = [camera.east ?? (xMin + xMax) / 2, camera.north ?? (yMin + yMax) / 2]; // in the middle
  return {
    scale,
    inner,
    middle,
    x: (metresEast) => middle.x + (metresEast - east) * scale,
    y: (metresNorth) => middle.y - (metresNorth - north) * scale,
    east: (x) => east + (x - middle.x) / scale,
    north: (y) => north - (y - middle.y) / scale,
  };
}

// Round numbers from low to high, about `wanted` of them.
function ticks(low, high, wanted) {
  const rough = (high - low) / Math.max(wanted, 1);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + step * 1e-9; k += 1) found.push(k * step);
  return found;
}

function drawAxes(context, run, view, width, height) {
  const unit = unitOf(run);
  const right = width - MARGIN.right;
  const bottom = height - MARGIN.bottom;
  context.fillStyle = colours.grey;
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  context.textAlign = "center";
  context.textBaseline = "top";
  for (const tick of ticks(view.east(MARGIN.left), view.east(right), view.inner.width / 90)) {
    line(context, view.x(tick), MARGIN.top, view.x(tick), bottom);
    context.fillText(minus(String(+(tick / unit.metres).toPrecision(6))), view.x(tick), bottom + 5);
  }
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const tick of ticks(view.north(bottom), view.north(MARGIN.top), view.inner.height / 70)) {
    line(context, MARGIN.left, view.y(tick), right, view.y(tick));
    context.fillText(minus(String(+(tick / unit.metres).toPrecision(6))), MARGIN.left - 5, view.y(tick));
  }
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(`x (${unit.name})`, (MARGIN.left + right) / 2, height - 2);
  context.save();
  context.translate(11, (MARGIN.top + bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "middle";
  context.fillText(`y (${unit.name})`, 0, 0);
  context.restore();
}

// A length in the lower right corner, with its unit.
function drawScale(context, view) {
  const power = 10 ** Math.floor(Math.log10(110 / view.scale));
  const length = [5, 2, 1].map((factor) => factor * power).find((size) => size * view.scale <= 110);
  const [right, bottom] = [MARGIN.left + view.inner.width - 12, MARGIN.top + view.inner.height - 12];
  const left = right - length * view.scale;
  for (const [shade, thick] of [[colours.paper, 5], [colours.ink, 2]]) {
    context.strokeStyle = shade;
    context.lineWidth = thick;
    context.beginPath();
    [[left, -5], [left, 0], [right, 0], [right, -5]].forEach(([x, up]) => context.lineTo(x, bottom + up));
    context.stroke();
  }
  const text = length >= 1000 ? `${+(length / 1000).toPrecision(3)} km` : `${+length.toPrecision(3)} m`;
  mark(context, text, (left + right) / 2, bottom - 10, colours.ink);
}

function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}
