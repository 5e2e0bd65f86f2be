// The runs that can be replayed, and numbers as a reader wants them.
const runs = JSON.parse(document.getElementById("runs").textContent);
// Curves of rewards whose actions are the same share their axis.
const joined = ({ curves }, axes) => curves.forEach((curve) => Object.assign(curve, axes[curve.along]));
for (const run of runs) run.decisions.forEach((decision) => joined(decision, run.axes));

const minus = (text) => text.replaceAll("-", "\u2212");
const fixed = (value, digits) => minus(value.toFixed(digits));
const bounded = (value, low, high) => Math.min(high, Math.max(low, value));

const extentOf = (run) => Math.max(run.extent[1] - run.extent[0], run.extent[3] - run.extent[2]);
const unitOf = (run) => (extentOf(run) > 5000 ? { name: "km", metres: 1000 } : { name: "m", metres: 1 });

// Distances with the digits that the size of the scene deserves.
const metres = (value, run) => (unitOf(run).metres === 1000 ? `${fixed(value / 1000, 2)} km` : `${fixed(value, 1)} m`);

// What a target is called: as who recorded it does, or else by its number.
const targetName = (run, target) => run.names[target - 1] ?? `target ${target}`;

// A time of a run by its clock: seconds, in UTC too where a recording says it, or alone where times are dates.
function clock(run, time) {
  if (time === null) return "no scan yet";
  const seconds = `${+time.toFixed(3)} s`;
  if (run.utc === null) return seconds;
  const text = new Date(1000 * (run.utc + time)).toISOString();
  const utc = `${text.slice(0, 10)} ${text.slice(11, 21)} UTC`;
  return run.utc ? `${utc} (t = ${seconds})` : utc;
}

// Hours, minutes and seconds UTC of a time of a run that has dates.
const clockTime = (run, time) => new Date(1000 * (run.utc + time)).toISOString().slice(11, 19);

const labelsOf = new Map();
// The place of a label among all labels of its run, which gives its colour; all alike where labels do not last.
function placeOfLabel(run, label) {
  if (!run.labelled) return 0;
  if (!labelsOf.has(run)) {
    const key = (text) => text.split(".").map(Number);
    const all = [...new Set(run.estimates.flat().map((estimate) => estimate[0]))];
    all.sort((a, b) => key(a)[0] - key(b)[0] || key(a)[1] - key(b)[1]);
    labelsOf.set(run, new Map(all.map((text, place) => [text, place])));
  }
  const places = labelsOf.get(run);
  if (!places.has(label)) places.set(label, places.size); // one that came while the run went on
  return places.get(label);
}

// The numbers of the targets that have an estimate at a scan.
const trackedAt = (run, step) => new Set(run.estimates[step].map((estimate) => estimate[7]));

// The last decision at or before a scan, or undefined.
const decisionAt = (run, step) => run.decisions.filter((decision) => decision.scan <= step).at(-1);
