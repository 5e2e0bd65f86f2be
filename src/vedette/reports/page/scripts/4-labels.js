// Names beside what they belong to, none over another name or mark; a name without a free place is left out.
const NAME_HEIGHT = 13; // pixels
const MOST_NAMES = 150;
const AROUND = [[1, -0.7], [1, 0.7], [-1, -0.7], [-1, 0.7], [0, -1], [0, 1], [1, 0], [-1, 0]];

const overlap = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
const boxAround = (x, y, radius) => ({ left: x - radius, right: x + radius, top: y - radius, bottom: y + radius });

// names: the more important ones first; marks: boxes that stay free.
function placeNames(context, view, names, marks) {
  const taken = [...marks];
  const edge = {
    left: MARGIN.left, top: MARGIN.top,
    right: MARGIN.left + view.inner.width, bottom: MARGIN.top + view.inner.height,
  };
  const inside = (box) => box.left >= edge.left && box.right <= edge.right && box.top >= edge.top && box.bottom <= edge.bottom;
  for (const { text, x, y, away, shade } of names.slice(0, MOST_NAMES)) {
    const half = context.measureText(text).width / 2 + 1;
    for (const [across, up] of AROUND) {
      const [middle, level] = [x + across * (away + half), y + up * (away + NAME_HEIGHT / 2)];
      const box = { left: middle - half, right: middle + half, top: level - NAME_HEIGHT / 2, bottom: level + NAME_HEIGHT / 2 };
      if (!inside(box) || taken.some((other) => overlap(box, other))) continue;
      taken.push(box);
      mark(context, text, middle, level, shade);
      break;
    }
  }
}

// The names of a scan: sensors, targets, and estimates by their labels, with flight levels if they have heights.
function drawNames(context, run, view, step, show) {
  const at = (x, y) => [view.x(x), view.y(y)];
  const names = [];
  const add = (text, [x, y], away, shade) => names.push({ text, x, y, away, shade });
  run.poses[step].forEach(([x, y], s) => add(clipped(run.sensors[s].name, 20), at(x, y), 8, colours.ink));
  for (const [target, x, y] of run.truth[step]) {
    add(clipped(run.names[target - 1] ?? `T${target}`, 20), at(x, y), 6, colours.ink);
  }
  (run.labelled ? run.estimates[step] : []).forEach((estimate, place) => {
    const height = run.heights?.estimates[step][place][0];
    const text = height === undefined ? estimate[0] : `${estimate[0]} ${flightLevel(height)}`;
    add(text, at(estimate[1], estimate[2]), 5, estimateShade(run, step, place, show));
  });
  const marks = [
    ...run.poses[step].map(([x, y]) => boxAround(...at(x, y), 7)),
    ...run.truth[step].map(([, x, y]) => boxAround(...at(x, y), 5)),
    ...run.estimates[step].map(([, x, y]) => boxAround(...at(x, y), 4)),
  ];
  placeNames(context, view, names, marks);
}
