// Colours of the page, as the style sheet has them in the light and in the dark.
const SENSORS = [1, 2, 3, 4, 5, 6].map((number) => `sensor-${number}`);
const SERIES = ["blue", "vermilion", "green", "purple", "orange", "sky", ...SENSORS];
let colours = {};

function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["ink", "paper", "line", "grey", "bad", "link", ...SERIES]) {
    colours[name] = style.getPropertyValue(`--${name}`).trim();
  }
}

const seriesColour = (index) => colours[SERIES[index % SERIES.length]];
const sensorShade = (sensor) => SENSORS[sensor % SENSORS.length];

// The colour of a strategy is its place among the runs of its group, as in the figures.
const strategyShade = (run) => {
  const names = [...new Set(runs.filter(({ group }) => group === run.group).map(({ strategy }) => strategy))];
  return SERIES[Math.max(0, names.indexOf(run.strategy)) % SERIES.length];
};

// Points of the colour map "cividis" of Matplotlib.
const HEAT = [
  [0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115],
  [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56],
];

function heatColour(share) {
  const place = bounded(share, 0, 1) * (HEAT.length - 1);
  const low = Math.min(Math.floor(place), HEAT.length - 2);
  const mixed = HEAT[low].map((value, i) => Math.round(value + (place - low) * (HEAT[low + 1][i] - value)));
  return `rgb(${mixed.join(",")})`;
}

// A canvas cleared for drawing in CSS pixels, sharp on any screen.
function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  return { context, width, height };
}
