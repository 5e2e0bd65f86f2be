// Below the maps: the error over time, decisions, events, and the scan that is shown; it can be dragged.
const LOST_FOR = 3; // scans without an estimate, from which on a target counts as lost
const EVENTS = {
  appears: { glyph: "\u25b2", shade: "grey" },
  ends: { glyph: "\u25bc", shade: "grey" },
  lost: { glyph: "\u2715", shade: "bad" },
  swapped: { glyph: "\u21c4", shade: "purple" },
};
const eventsFound = new WeakMap();

// What happens to the targets of a run: they appear, end, are lost, or go on under another label.
function eventsOf(run) {
  if (!run.known) return [];
  if (!eventsFound.has(run)) eventsFound.set(run, [...new Set(run.truth.flat().map(([target]) => target))].flatMap((target) => eventsOfTarget(run, target)));
  return eventsFound.get(run);
}

function eventsOfTarget(run, target) {
  const name = targetName(run, target);
  const found = [];
  let [label, missed, before] = [null, LOST_FOR, false];
  run.truth.forEach((rows, step) => {
    const alive = rows.some(([other]) => other === target);
    if (alive !== before && step > 0) found.push({ step, kind: alive ? "appears" : "ends", text: `${name} ${alive ? "appears" : "ends"}` });
    before = alive;
    if (!alive) return;
    const estimate = run.estimates[step].find((each) => each[7] === target);
    missed = estimate ? 0 : missed + 1;
    if (missed === LOST_FOR && label !== null) found.push({ step: step - LOST_FOR + 1, kind: "lost", text: `${name} lost` });
    if (!estimate) return;
    if (run.labelled && label !== null && estimate[0] !== label) found.push({ step, kind: "swapped", text: `${name}: label ${label} becomes ${estimate[0]}` });
    [label] = estimate;
  });
  return found;
}

// The value over time: OSPA where the targets are known, and else the number of estimates.
const valuesOf = (run) => (run.known ? run.ospa.map(([total]) => total) : run.estimates.map((rows) => rows.length));

function timelineFrame(width, height, all) {
  const times = all[0].times.filter((time) => time !== null);
  return {
    left: MARGIN.left, right: width - MARGIN.right, top: 20, bottom: height - 36,
    x: [times[0] ?? 0, times.at(-1) ?? 1], y: [0, Math.max(1, ...all.flatMap(valuesOf))],
  };
}

// paired: other runs of the same targets and noise; second: the one beside or over the run that is shown.
function drawTimeline(canvas, run, step, paired, second) {
  const { context, width, height } = prepared(canvas);
  if (width < 150) return; // not laid out yet
  const frame = timelineFrame(width, height, [run, ...paired]);
  const { x, y } = drawFrame(context, frame, run.utc === null ? "time (s)" : "time (UTC)", run.utc === null ? null : (time) => clockTime(run, time));
  drawSide(context, frame, run.known ? `OSPA${run.ospa_unit && ` (${run.ospa_unit})`}` : "estimates");
  context.strokeStyle = colours.ink;
  context.lineWidth = 1;
  for (const { scan } of run.decisions) line(context, x(run.times[scan]), frame.bottom - 5, x(run.times[scan]), frame.bottom);
  for (const other of [...paired, run]) {
    context.strokeStyle = colours[strategyShade(other)];
    context.lineWidth = other === run ? 2.2 : other === second ? 1.8 : 0.9;
    context.beginPath();
    valuesOf(other).forEach((value, k) => other.times[k] !== null && context.lineTo(x(other.times[k]), y(value)));
    context.stroke();
  }
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const { step: at, kind } of eventsOf(run)) {
    context.fillStyle = colours[EVENTS[kind].shade];
    context.fillText(EVENTS[kind].glyph, x(run.times[at]), 10);
  }
  if (run.times[step] == null) return;
  context.strokeStyle = context.fillStyle = colours.link;
  context.lineWidth = 1.5;
  line(context, x(run.times[step]), 2, x(run.times[step]), frame.bottom);
  disc(context, x(run.times[step]), frame.bottom, 6);
}

function drawSide(context, frame, text) {
  context.save();
  context.fillStyle = colours.grey;
  context.translate(11, (frame.top + frame.bottom) / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(text, 0, 0);
  context.restore();
}

// The time at a pixel of the timeline.
function timeAt(canvas, run, px) {
  const frame = timelineFrame(canvas.clientWidth, canvas.clientHeight, [run]);
  const share = bounded((px - frame.left) / (frame.right - frame.left), 0, 1);
  return frame.x[0] + share * (frame.x[1] - frame.x[0]);
}

// Events within a few pixels, in words.
function describeEvents(canvas, run, px) {
  const near = (6 * (timeAt(canvas, run, canvas.clientWidth) - timeAt(canvas, run, 0))) / canvas.clientWidth;
  const time = timeAt(canvas, run, px);
  return eventsOf(run).filter(({ step }) => Math.abs(run.times[step] - time) <= near).slice(0, 6)
    .map(({ step, text }) => `${clock(run, run.times[step])}: ${text}`);
}
