// Longitude and latitude (WGS 84) of a place in the plane that touches the Earth at an origin.
const [RADIUS, FLATTENING] = [6378137, 1 / 298.257223563];
const SQUASH = FLATTENING * (2 - FLATTENING);

function onEarth(lon, lat) {
  const across = RADIUS / Math.sqrt(1 - SQUASH * Math.sin(lat) ** 2);
  const out = across * Math.cos(lat);
  return [out * Math.cos(lon), out * Math.sin(lon), across * (1 - SQUASH) * Math.sin(lat)];
}

// Radians of the point of the ellipsoid below a place; undefined where there is none near enough.
function earthBelow([lonDegrees, latDegrees], east, north) {
  const [lon0, lat0] = [lonDegrees, latDegrees].map((value) => (value * Math.PI) / 180);
  const start = onEarth(lon0, lat0);
  let [lon, lat, offEast, offNorth] = [lon0, lat0, east, north];
  for (let k = 0; k < 60; k += 1) {
    const flat = 1 - SQUASH * Math.sin(lat) ** 2;
    lat += (offNorth * flat ** 1.5) / (RADIUS * (1 - SQUASH));
    lon += (offEast * Math.sqrt(flat)) / (RADIUS * Math.max(Math.cos(lat), 1e-6));
    const [x, y, z] = onEarth(lon, lat).map((value, axis) => value - start[axis]);
    offEast = east - (y * Math.cos(lon0) - x * Math.sin(lon0));
    offNorth = north - (z * Math.cos(lat0) - (x * Math.cos(lon0) + y * Math.sin(lon0)) * Math.sin(lat0));
    if (Math.hypot(offEast, offNorth) < 0.01) return [lon, lat];
  }
  return undefined;
}

// Radians clockwise from true north at a place, of an angle of the plane; without an origin north is along y.
function azimuthOf(run, east, north, angle) {
  const found = run.origin && earthBelow(run.origin, east, north);
  if (!found) return Math.PI / 2 - angle;
  const [off, start] = [found[0] - (run.origin[0] * Math.PI) / 180, (run.origin[1] * Math.PI) / 180];
  const [eastX, northX] = [Math.cos(off), -Math.sin(found[1]) * Math.sin(off)];
  const eastY = Math.sin(start) * Math.sin(off);
  const northY = Math.sin(start) * Math.sin(found[1]) * Math.cos(off) + Math.cos(start) * Math.cos(found[1]);
  const [along, up] = [Math.cos(angle), Math.sin(angle)];
  return Math.atan2(northY * along - northX * up, eastX * up - eastY * along);
}

// A direction in whole degrees: from 0 to 359 clockwise from true north, or counter-clockwise from east without a compass.
function directionOf(run, east, north, angle) {
  if (!run.compass) return minus(String(Math.round((angle * 180) / Math.PI)));
  return String((Math.round((azimuthOf(run, east, north, angle) * 180) / Math.PI) + 360) % 360);
}

// `50.78650° N, 1.11710° W`; nothing where there is no origin.
function degreesOf(run, east, north) {
  const found = run.origin && earthBelow(run.origin, east, north);
  if (!found) return "";
  const [lon, lat] = found.map((value) => (value * 180) / Math.PI);
  const turned = ((lon + 540) % 360) - 180;
  const told = (value, [plus, less]) => `${Math.abs(value).toFixed(5)}\u00b0 ${value < 0 ? less : plus}`;
  return `${told(lat, "NS")}, ${told(turned, "EW")}`;
}
