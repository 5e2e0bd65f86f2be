// The state of the replay, its controls, and the words beside the picture.
const SPEEDS = [1, 10, 60]; // times real time
const MOST_SECONDS = 20; // that a run plays at the speed that is chosen first

function startReplay(root) {
  const part = (name) => root.querySelector(`[data-part="${name}"]`);
  const state = { run: 0, step: 0, time: 0, playing: false, speed: 1, view: null, pointer: null, ghost: null, shown: null };
  const shown = () => Object.fromEntries([...root.querySelectorAll("[data-show]")].map((box) => [box.dataset.show, box.checked]));
  const show = () => ({ ...shown(), shade: panels.all().length ? strategyShade(run()) : null });

  const run = () => state.shown ?? runs[state.run];
  const { live } = runs[0]; // frames come while it is shown; to play is to stay at the latest
  const last = () => run().times.length - 1;
  const camera = cameraOf(part("scene"), run, () => draw());
  const panels = panelsOf(part("panels"), (panel) => {
    camera.attach(panel.canvas);
    point(panel.canvas, panel);
  });

  const paired = () => runs.filter((each, place) => place !== state.run && each.group === run().group && each.run === run().run);

  function draw() {
    state.view = drawScene(part("scene"), run(), state.step, show(), camera.aim(state.step), state.ghost);
    panels.draw(run().times[state.step], shown(), camera.camera);
    part("modes-key").hidden = !show().modes || panels.all().length > 0;
    part("caption").textContent = captionOf(run(), state.step);
    part("caption").style.borderColor = `var(--${strategyShade(run())})`;
    const decision = decisionAt(run(), state.step);
    part("reward-block").hidden = !decision?.curves.length;
    part("gains").hidden = !decision?.why;
    drawRewards(part("rewards"), decision, run());
    drawTimeline(part("errors"), run(), state.step, paired(), state.ghost ?? runs[part("beside").value || -1]);
    part("heights").hidden = !run().heights;
    if (run().heights) drawHeights(part("heights"), run(), state.step);
    tell();
  }

  function tell() {
    const decision = decisionAt(run(), state.step);
    const { times, truth, estimates, ospa, ospa_unit } = run();
    const time = clock(run(), times[state.step]);
    const words = [`${estimates[state.step].length} estimates`];
    if (run().known) {
      const [total, localisation, cardinality] = ospa[state.step];
      words.unshift(`${truth[state.step].length} targets`);
      words.push(`OSPA ${total.toFixed(1)}${ospa_unit && ` ${ospa_unit}`} (localisation ${localisation.toFixed(1)}, cardinality ${cardinality.toFixed(1)})`);
    }
    const lead = run().utc === null && times[state.step] !== null ? "t = " : "";
    part("summary").textContent = `${lead}${time}: ${words.join(", ")}`;
    part("decision").textContent = decisionText();
    part("decision-notes").textContent = (decision?.notes ?? []).map((note) => `Note: ${note}.`).join(" ");
    part("reward-title").textContent = run().reward ? `Reward (${run().reward})` : "Reward";
    tellWhy(part, run(), decision);
    part("scene").setAttribute("aria-label", `${run().strategy}, run ${run().run}, ${part("summary").textContent}`);
    part("scrubber").value = state.step;
    part("scrubber").setAttribute("aria-valuetext", `step ${state.step + 1} of ${last() + 1}, ${time}`);
    part("play").textContent = state.playing ? "Pause" : live ? "Follow" : "Play";
    Object.assign(root.dataset, { step: state.step, run: state.run, playing: state.playing, speed: state.speed });
    root.dataset.zoom = +camera.camera.zoom.toFixed(3);
    part("follow").value = camera.camera.follow;
    tellPointer();
    if (part("values").open) fillValues();
  }

  function decisionText() {
    const decision = decisionAt(run(), state.step);
    if (!decision) return "No decision yet.";
    const without = decision.curves.length ? "" : ", without rewards";
    const actions = decision.why?.sensors.length ? "" : `: ${minus(decision.actions)}`; // the sentences say them
    return `Decision at ${clock(run(), run().times[decision.scan])}${without}${actions}.`;
  }

  function underPointer() {
    const { pointer, view } = state;
    if (pointer?.panel) {
      const { panel, x, y } = pointer;
      return panel.view ? describeAt(panel.run, panel.step, panel.view, x, y, show()) : [];
    }
    if (pointer?.part === "scene") return describeAt(run(), state.step, view, pointer.x, pointer.y, show());
    if (!pointer) return [];
    if (pointer.part === "errors") return describeEvents(part("errors"), run(), pointer.x);
    return describeReward(part("rewards"), run(), decisionAt(run(), state.step), pointer.x, pointer.y);
  }

  function tellPointer() {
    const found = underPointer();
    const hover = part("hover");
    hover.textContent = found.join("\n");
    hover.hidden = !found.length;
    if (found.length) {
      const box = root.getBoundingClientRect();
      hover.style.left = `${Math.min(state.pointer.clientX - box.left + 14, box.width - Math.min(340, box.width))}px`;
      hover.style.top = `${state.pointer.clientY - box.top + 16}px`;
    }
    root.dataset.hover = found.length;
    tellPlace();
  }

  // Where the pointer is, or else what is in the middle of the scene.
  function tellPlace() {
    const { pointer, view } = state;
    if (!view || view.scale <= 0) return;
    const { x, y } = pointer?.part === "scene" ? pointer : view.middle;
    const [east, north] = [view.east(x), view.north(y)];
    const words = [`${metres(east, run())}, ${metres(north, run())}`, degreesOf(run(), east, north)].filter(Boolean);
    part("place").textContent = `${pointer?.part === "scene" ? "Pointer" : "Middle"}: ${words.join("; ")}`;
  }

  function fillValues() {
    const rows = [
      ...run().truth[state.step].map(([target, x, y, ...velocity], place) => (
        describeTarget(run(), target, x, y, velocity) + heightWords(run().heights?.truth[state.step][place])
      )),
      ...run().estimates[state.step].map((_, place) => estimateInWords(run(), state.step, place)),
    ];
    part("rows").replaceChildren(...rows.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  }

  function go(step, time = null) {
    state.step = bounded(step, 0, last());
    state.time = time ?? run().times[state.step] ?? 0;
    if (state.step === last() && !live) state.playing = false;
    draw();
  }

  // Fill a field with choices, none of them first; what was chosen stays if it is still there.
  function offer(field, choices) {
    const chosen = field.value;
    field.replaceChildren(...[["", "nothing"], ...choices].map(([value, text]) => new Option(text, value)));
    field.value = choices.some(([value]) => value === chosen) ? chosen : "";
    field.parentElement.hidden = !choices.length;
  }

  function haunt() {
    state.ghost = runs[part("ghost").value || -1] ?? null;
    part("ghost-key").hidden = !state.ghost;
  }

  // Other runs beside this one, in a plane that holds all of them.
  function accompany() {
    const others = part("beside").value ? [runs[part("beside").value]] : [];
    state.shown = others.length ? inOnePlane(runs[state.run], others) : null;
    panels.show(run(), others);
    part("stage").classList.toggle("beside", others.length > 0);
    part("caption").hidden = !others.length;
    press(state.run, others.length ? Number(part("beside").value) : null);
  }

  function choose(index) {
    if (runs[index].group !== run().group) Object.assign(camera.camera, { zoom: 1, east: null, north: null });
    state.run = index;
    state.shown = null;
    state.playing = false;
    offer(part("follow"), followable(run()));
    camera.camera.follow = part("follow").value;
    const others = paired().map((each) => [String(runs.indexOf(each)), clipped(each.strategy, 30)]);
    offer(part("ghost"), others);
    haunt();
    offer(part("beside"), others);
    part("run").value = index;
    accompany();
    reveal();
    go(Math.min(state.step, last()));
  }

  // What the run has is shown.
  function reveal() {
    part("scrubber").max = last();
    part("nothing").hidden = run().scans.length > 0;
    const searches = run().decisions.some((decision) => decision.undetected);
    for (const name of ["undetected", "undetected-key"]) part(name).hidden = !searches;
    part("modes").hidden = !run().modes;
    part("modes-key").replaceChildren(
      ...(run().mode_names ?? []).map((name, mode) => {
        const [key, disc] = [element("span", "key"), element("i", "dot")];
        disc.style.background = `var(--${SERIES[mode % SERIES.length]})`;
        key.append(disc, ` in mode ${name}`);
        return key;
      }),
    );
    part("lost-key").hidden = !run().known;
    part("side").hidden = !run().decisions.length;
    part("stage").classList.toggle("alone", !run().decisions.length);
  }

  // More of the run has come, and of the oldest steps some have gone.
  function arrived(dropped) {
    state.step = state.playing ? last() : bounded(state.step - dropped, 0, last());
    if (document.activeElement !== part("follow")) offer(part("follow"), followable(run()));
    reveal();
    pending ||= requestAnimationFrame(() => {
      pending = 0;
      draw();
    });
  }

  let [before, pending] = [null, 0];
  function tick(now) {
    if (!state.playing || live) return;
    if (before === null) before = now;
    const time = state.time + ((now - before) / 1000) * state.speed;
    before = now;
    const step = stepAt(run(), time);
    if (step !== state.step) go(step, time);
    else state.time = time;
    if (state.playing) requestAnimationFrame(tick);
  }

  function play(wanted) {
    if (live && wanted) state.step = last();
    else if (wanted && state.step === last()) state.step = 0;
    state.playing = wanted;
    state.time = run().times[state.step] ?? 0;
    before = null;
    draw();
    if (wanted) requestAnimationFrame(tick);
  }

  const step = (by) => {
    state.playing = false;
    go(state.step + by);
  };
  const keys = {
    " ": () => play(!state.playing),
    ArrowRight: () => step(1),
    ArrowLeft: () => step(-1),
    Home: () => step(-Infinity),
    End: () => step(Infinity),
    "+": () => camera.zoomBy(1.5),
    "=": () => camera.zoomBy(1.5),
    "-": () => camera.zoomBy(1 / 1.5),
    0: () => camera.reset(),
    "shift ArrowRight": () => camera.pan(-PAN, 0),
    "shift ArrowLeft": () => camera.pan(PAN, 0),
    "shift ArrowUp": () => camera.pan(0, PAN),
    "shift ArrowDown": () => camera.pan(0, -PAN),
  };

  part("play").addEventListener("click", () => play(!state.playing));
  part("back").addEventListener("click", () => step(-1));
  part("forward").addEventListener("click", () => step(1));
  part("scrubber").addEventListener("input", (event) => step(Number(event.target.value) - state.step));
  part("run").addEventListener("change", (event) => choose(Number(event.target.value)));
  part("speed").addEventListener("change", (event) => {
    state.speed = Number(event.target.value);
    before = null;
    tell();
  });
  part("zoom-in").addEventListener("click", () => camera.zoomBy(1.5));
  part("zoom-out").addEventListener("click", () => camera.zoomBy(1 / 1.5));
  part("reset").addEventListener("click", camera.reset);
  part("follow").addEventListener("change", (event) => camera.follow(event.target.value));
  part("ghost").addEventListener("change", () => {
    haunt();
    draw();
  });
  part("beside").addEventListener("change", () => {
    accompany();
    draw();
  });
  root.querySelectorAll("[data-show]").forEach((box) => box.addEventListener("change", draw));
  part("values").addEventListener("toggle", tell);
  root.addEventListener("keydown", (event) => {
    // Fields and buttons keep the keys that are theirs; a slider has no use for the space bar.
    const own = event.target.closest("select, input, button, summary");
    const isFree = event.key === " " && own?.type === "range";
    const key = event.shiftKey && event.key.startsWith("Arrow") ? `shift ${event.key}` : event.key;
    if ((own && !isFree) || event.ctrlKey || event.metaKey || event.altKey || !(key in keys)) return;
    event.preventDefault();
    keys[key]();
  });
  // Have what is under the pointer on a canvas told: of a part of this run, or of a panel.
  function point(canvas, panel, name = "scene") {
    const follow = (event) => {
      const box = canvas.getBoundingClientRect();
      const { clientX, clientY } = event;
      state.pointer = { part: name, panel, x: clientX - box.left, y: clientY - box.top, clientX, clientY };
      if (name === "errors" && canvas.hasPointerCapture(event.pointerId)) {
        state.playing = false;
        go(stepAt(run(), timeAt(canvas, run(), state.pointer.x)));
      }
      tellPointer();
    };
    canvas.addEventListener("pointermove", follow);
    canvas.addEventListener("pointerdown", (event) => {
      if (name === "errors") canvas.setPointerCapture(event.pointerId);
      follow(event);
    });
    canvas.addEventListener("pointerleave", () => {
      state.pointer = null;
      tellPointer();
    });
  }
  point(part("scene"), null);
  point(part("rewards"), null, "rewards");
  point(part("errors"), null, "errors");

  const redraw = () => {
    readColours();
    draw();
  };
  new ResizeObserver(redraw).observe(part("scene"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  readColours();
  const press = tabsOf(part("tabs"), part("run"), choose);
  choose(0);
  if (!live) {
    const seconds = run().times.at(-1) - run().times[0];
    state.speed = SPEEDS.find((speed) => seconds / speed <= MOST_SECONDS) ?? SPEEDS.at(-1);
    part("speed").value = state.speed;
  }
  if ("together" in root.dataset) {
    part("beside").selectedIndex = 1;
    accompany();
    go(mostApart(run(), [runs[part("beside").value]]));
  }
  return { arrived, play };
}

// The first scan at which the errors of runs differ nearly as much as they ever do.
function mostApart(run, others) {
  if (!run.known || !others.length) return 0;
  const apart = run.ospa.map((_, step) => {
    const values = [run, ...others].map(({ ospa }) => ospa[step]?.[0] ?? 0);
    return Math.max(...values) - Math.min(...values);
  });
  const most = Math.max(...apart);
  return apart.findIndex((value) => value >= 0.9 * most);
}

const replay = document.getElementById("replay");
if (replay && runs.length && !runs[0].live) startReplay(replay);
