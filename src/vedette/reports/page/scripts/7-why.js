// Below the plane: why the last decision was taken. Bars of what targets and sensors contribute, and the second best.
const short = (value) => minus(value === 0 ? "0" : Math.abs(value) >= 1000 ? value.toFixed(0) : value.toPrecision(3));

function element(name, className, text = "") {
  const made = document.createElement(name);
  if (className) made.className = className;
  made.textContent = text;
  return made;
}

// One row of bars: a name, segments one after the other from 0 to either side, and numbers behind.
function barRow({ name, segments, numbers, title }, [low, high]) {
  const row = element("li", "bar-row");
  row.title = title;
  const track = element("span", "track");
  const place = (value) => (100 * (value - low)) / (high - low || 1);
  const ends = { up: 0, down: 0 };
  for (const { value, shade } of segments) {
    const side = value < 0 ? "down" : "up";
    const [from, to] = [ends[side], ends[side] + value].sort((a, b) => a - b);
    ends[side] += value;
    const bar = element("i");
    Object.assign(bar.style, { left: `${place(from)}%`, width: `${place(to) - place(from)}%`, background: `var(--${shade})` });
    track.append(bar);
  }
  const zero = element("i", "zero");
  zero.style.left = `${place(0)}%`;
  track.append(zero);
  row.append(element("span", "name", name), track, ...numbers.map((text) => element("span", "number", text)));
  return row;
}

function fillBars(list, rows) {
  const sums = rows.flatMap(({ segments }) => [1, -1].map((sign) =>
    segments.reduce((total, { value }) => total + (value * sign > 0 ? value : 0), 0)));
  const span = [Math.min(0, ...sums), Math.max(0, ...sums)];
  list.replaceChildren(...rows.map((row) => barRow(row, span)));
}

function targetRows(why) {
  const rows = why.targets.map(([label, existence, localisation]) => ({
    name: label,
    segments: [{ value: existence, shade: "orange" }, { value: localisation, shade: "blue" }],
    numbers: [short(existence + localisation)],
    title: `${label}: existence ${short(existence)}, localisation ${short(localisation)}`,
  }));
  if (why.more) {
    const [number, existence, localisation] = why.more;
    rows.push({
      name: `${number} more`,
      segments: [],
      numbers: [short(existence + localisation)],
      title: `${number} more targets together: existence ${short(existence)}, localisation ${short(localisation)}`,
    });
  }
  if (why.undetected) {
    rows.push({
      name: "not found before",
      segments: [{ value: why.undetected, shade: "green" }],
      numbers: [short(why.undetected)],
      title: `targets that were not found before: ${short(why.undetected)}`,
    });
  }
  if (why.price) {
    rows.push({
      name: "price",
      segments: [{ value: -why.price, shade: "orange" }],
      numbers: [short(-why.price)],
      title: `price of the actions: ${short(why.price)}`,
    });
  }
  return rows;
}

const sensorRows = (why, names) => why.sensors.map(([sensor, action, share, without]) => ({
  name: `${names[sensor]}: ${minus(action)}`,
  segments: [{ value: share, shade: sensorShade(sensor) }],
  numbers: [short(share), short(without)],
  title: `${names[sensor]}, ${minus(action)}: share ${short(share)}; the reward had it not scanned: ${short(without)}`,
}));

// What a sensor does, and what its scan is worth.
const sensorSentences = (why, names) => why.sensors.map(([sensor, action, share, without]) => {
  const worth = share ? `Its scan adds ${short(share)} to the reward, which is ${short(without)} without it.` : "Its scan adds nothing to the reward.";
  return `${names[sensor]}: ${minus(action)}. ${worth}`;
});

// In place of the bars where there are none.
function whyNot(decision) {
  if (!decision || decision.why) return "";
  return decision.curves.length ? "This decision was kept without why it was taken." : "This decision was not made on rewards.";
}

let explained;
function tellWhy(part, run, decision) {
  const key = decision ?? run;
  if (explained === key) return;
  explained = key;
  const why = decision?.why;
  part("why-not").textContent = whyNot(decision);
  part("why").hidden = !why;
  if (!why) return;
  const names = run.sensors.map(({ name }) => name);
  part("why-words").replaceChildren(...sensorSentences(why, names).map((text) => element("li", "", text)));
  part("why-facts").replaceChildren(...why.facts.flatMap(([name, text]) => [element("dt", "", name), element("dd", "", minus(text))]));
  for (const [name, rows] of [["targets", targetRows(why)], ["sensors", sensorRows(why, names)]]) {
    fillBars(part(`why-${name}`), rows);
    part(`why-${name}`).parentElement.hidden = rows.length === 0;
  }
}
