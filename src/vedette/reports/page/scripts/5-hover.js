// What lies under the pointer, in words.
const REACH = 12; // pixels

function describeAt(run, step, view, x, y, show) {
  const found = [];
  const near = (east, north, reach = REACH) => Math.hypot(view.x(east) - x, view.y(north) - y) <= reach;
  run.truth[step].forEach(([target, east, north, ...velocity], place) => {
    if (near(east, north)) found.push(describeTarget(run, target, east, north, velocity) + heightWords(run.heights?.truth[step][place]));
  });
  run.estimates[step].forEach((estimate, place) => {
    if (near(estimate[1], estimate[2])) found.push(estimateInWords(run, step, place));
  });
  run.poses[step].forEach(([east, north, heading, pointing], s) => {
    if (near(east, north)) {
      const at = `${metres(east, run)}, ${metres(north, run)}`;
      const [ahead, aside] = run.compass ? ["course", "azimuth"] : ["heading", "pointing"];
      const along = (angle) => `${directionOf(run, east, north, angle)}\u00b0`;
      found.push(`${run.sensors[s].name}: at ${at}, ${ahead} ${along(heading)}${pointing === undefined ? "" : `, ${aside} ${along(pointing)}`}`);
    }
  });
  if (show.measurements && found.length < 3) found.push(...measurementsAt(run, step, view, x, y).slice(0, 3));
  return found;
}

const flightLevel = (height) => `FL${String(Math.max(0, Math.round(height / 30.48))).padStart(3, "0")}`;

const classWords = (likeliest) => likeliest ? `; ${likeliest[0]} ${likeliest[1].toFixed(2)}` : "";

function heightWords(height, std) {
  if (height === undefined) return "";
  return `; height ${fixed(height, 0)} m${std === undefined ? "" : ` \u00b1 ${fixed(std, 0)}`} (${flightLevel(height)})`;
}

function describeTarget(run, target, east, north, velocity) {
  const course = run.compass ? `, course ${directionOf(run, east, north, Math.atan2(velocity[1], velocity[0]))}\u00b0` : "";
  const speed = velocity.length > 1 ? `${course}, speed ${fixed(Math.hypot(velocity[0], velocity[1]), 1)} m/s` : "";
  return `${targetName(run, target)}: at ${metres(east, run)}, ${metres(north, run)}${speed}`;
}

function estimateInWords(run, step, place) {
  const words = classWords(run.classes?.[step][place]) + heightWords(...(run.heights?.estimates[step][place] ?? []));
  return describeEstimate(run, run.estimates[step][place]) + words;
}

function describeEstimate(run, [label, east, north, existence, long, short, , target, error]) {
  const of = target ? `${metres(error, run)} from ${targetName(run, target)}; ` : run.known ? "false: no target is matched; " : "";
  const at = `${metres(east, run)}, ${metres(north, run)}`;
  const size = `2\u03c3 ${metres(long, run)} by ${metres(short, run)}`;
  return `estimate${run.labelled ? ` ${label}` : ""}: ${of}existence ${existence.toFixed(3)}; at ${at}; ${size}`;
}

function measurementsAt(run, step, view, x, y) {
  const found = [];
  run.sensors.forEach(({ kind, name }, s) => {
    const [east, north] = run.poses[step][s];
    const [px, py] = [view.x(east), view.y(north)];
    for (const [origin, u, v] of (run.scans[step] ?? [])[s] ?? []) {
      const what = origin === UNKNOWN ? "measurement" : origin ? `detection of ${targetName(run, origin)}` : "clutter";
      if (distanceTo(kind, view, x, y, px, py, u, v) <= REACH / 2) {
        found.push(`${what} of ${name}: ${describeMeasurement(run, kind, east, north, u, v)}`);
      }
    }
  });
  return found;
}

// Pixels from the pointer to a measurement: a point, a ray from the sensor, or a circle around it.
function distanceTo(kind, view, x, y, px, py, u, v) {
  if (kind === "circle") return Math.abs(Math.hypot(x - px, y - py) - u * view.scale);
  if (kind === "ray") {
    const along = (x - px) * Math.cos(u) - (y - py) * Math.sin(u);
    const across = (x - px) * Math.sin(u) + (y - py) * Math.cos(u);
    return along < 0 ? Infinity : Math.abs(across);
  }
  return kind === "none" ? Infinity : Math.hypot(view.x(u) - x, view.y(v) - y);
}

function describeMeasurement(run, kind, east, north, u, v) {
  if (kind === "ray") return `bearing ${directionOf(run, east, north, u)}\u00b0`;
  if (kind === "circle") return `range ${metres(u, run)}`;
  if (kind === "position") return `at ${metres(u, run)}, ${metres(v, run)}`;
  return `bearing ${directionOf(run, east, north, Math.atan2(v - north, u - east))}\u00b0, range ${metres(Math.hypot(u - east, v - north), run)}`;
}
