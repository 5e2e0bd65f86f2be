// Which part of the plane is shown: zoom, pan, and what stays in the middle.
const MOST_ZOOM = 400;
const PAN = 60; // pixels that a key moves the plane by
const FOLLOWING = 3; // least zoom at which something is followed
const MOST_FOLLOWED = 60;

// What can be followed, each with its name: sensors, targets, or where nobody knows these the longest tracks.
function followable(run) {
  const found = run.sensors.map(({ name }, s) => [`sensor ${s}`, clipped(name, 30)]);
  if (run.known) {
    const targets = [...new Set(run.truth.flat().map(([target]) => target))].sort((a, b) => a - b);
    found.push(...targets.slice(0, MOST_FOLLOWED).map((target) => [`target ${target}`, clipped(targetName(run, target), 30)]));
  } else if (run.labelled) {
    const lengths = new Map();
    for (const [label] of run.estimates.flat()) lengths.set(label, (lengths.get(label) ?? 0) + 1);
    const longest = [...lengths].sort((a, b) => b[1] - a[1]).slice(0, MOST_FOLLOWED);
    found.push(...longest.map(([label]) => [`track ${label}`, `track ${label}`]));
  }
  return found;
}

// Where a followed thing is at a scan; undefined where it is not there.
function placeOf(run, step, followed) {
  const [kind, key] = followed.split(" ");
  if (kind === "sensor") return run.poses[step][Number(key)];
  const rows = kind === "target" ? run.truth[step] : run.estimates[step];
  return rows.find(([name]) => String(name) === key)?.slice(1, 3);
}

function cameraOf(canvas, run, redraw) {
  const camera = { zoom: 1, east: null, north: null, follow: "" };
  const view = () => viewOf(run(), canvas.clientWidth, canvas.clientHeight, camera);
  let canvases = [];

  function reset() {
    Object.assign(camera, { zoom: 1, east: null, north: null, follow: "" });
    redraw();
  }

  // Zoom so that what is at a pixel stays there, or else what is in the middle; false where there is no more of it.
  function zoomBy(factor, at) {
    const before = view();
    const zoom = bounded(camera.zoom * factor, 1, MOST_ZOOM);
    if (zoom === camera.zoom || before.scale <= 0) return false;
    const { x, y } = camera.follow || !at ? before.middle : at;
    const scale = (before.scale * zoom) / camera.zoom;
    camera.east = before.east(x) - (x - before.middle.x) / scale;
    camera.north = before.north(y) + (y - before.middle.y) / scale;
    camera.zoom = zoom;
    if (zoom === 1 && !camera.follow) Object.assign(camera, { east: null, north: null });
    redraw();
    return true;
  }

  // Move the plane by pixels; nothing is followed any more. The whole scene stays where it is.
  function pan(dx, dy) {
    if (camera.zoom === 1) return;
    const { middle, scale, east, north } = view();
    const [xMin, xMax, yMin, yMax] = run().extent;
    camera.follow = "";
    camera.east = bounded(east(middle.x) - dx / scale, xMin, xMax);
    camera.north = bounded(north(middle.y) + dy / scale, yMin, yMax);
    redraw();
  }

  function follow(what) {
    camera.follow = what;
    if (what) camera.zoom = Math.max(camera.zoom, FOLLOWING);
    redraw();
  }

  // Before a scan is drawn: what is followed goes to the middle, or stays where it was last.
  function aim(step) {
    const place = camera.follow && placeOf(run(), step, camera.follow);
    if (place) [camera.east, camera.north] = place;
    canvases = canvases.filter((each) => each.isConnected);
    for (const { style } of canvases) {
      style.touchAction = camera.zoom > 1 ? "none" : "pan-y"; // the whole scene lets the page scroll
      style.cursor = camera.zoom > 1 ? "grab" : "";
    }
    return camera;
  }

  // Have the mouse and fingers move the plane on a canvas, one of the size of all others.
  function attach(surface) {
    canvases.push(surface);
    const places = new Map();
    const at = (event) => {
      const box = surface.getBoundingClientRect();
      return { x: event.clientX - box.left, y: event.clientY - box.top };
    };
    surface.addEventListener("wheel", (event) => {
      const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
      if (zoomBy(Math.exp(-pixels * 0.002), at(event))) event.preventDefault();
    }, { passive: false });
    surface.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      places.set(event.pointerId, at(event));
      surface.setPointerCapture(event.pointerId);
    });
    surface.addEventListener("pointermove", (event) => {
      const before = places.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      const other = [...places].find(([id]) => id !== event.pointerId)?.[1];
      places.set(event.pointerId, now);
      if (!other) pan(now.x - before.x, now.y - before.y);
      else {
        const apart = (place) => Math.max(10, Math.hypot(place.x - other.x, place.y - other.y));
        pan((now.x - before.x) / 2, (now.y - before.y) / 2);
        zoomBy(apart(now) / apart(before), { x: (now.x + other.x) / 2, y: (now.y + other.y) / 2 });
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      surface.addEventListener(name, (event) => places.delete(event.pointerId));
    }
  }

  attach(canvas);
  return { camera, reset, zoomBy, pan, follow, aim, attach };
}
