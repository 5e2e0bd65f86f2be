// A loop that goes on: each frame that comes is a step more of the run that the page shows.
const KEPT = 600; // frames
const AGAIN = 1000; // ms until the next try to connect
const FORGET = 1000; // labels, beyond which colours begin anew

function startLive(root, run) {
  const part = (name) => document.querySelector(`[data-part="${name}"]`);
  const heights = run.heights ?? { estimates: [], truth: [] };
  const series = [run.times, run.truth, run.estimates, run.poses, run.scans, heights.estimates, heights.truth];
  const link = { since: null, frameAt: null, skipped: 0 };
  let [player, number] = [null, 0];

  // Back to before a time that comes again: scans of one time one after the other, or a loop that was taken up again.
  function rewind(time) {
    while (run.times.length && (time === null || run.times.at(-1) === null || run.times.at(-1) >= time)) {
      series.forEach((values) => values.pop());
    }
    for (const decision of run.decisions) decision.scan = Math.min(decision.scan, run.times.length);
  }

  // What is too old goes; of the decisions the last one stays.
  function forget() {
    const dropped = Math.max(0, run.times.length - KEPT);
    series.forEach((values) => values.splice(0, dropped));
    for (const decision of run.decisions) decision.scan -= dropped;
    const kept = run.decisions.filter(({ scan }, place) => scan >= 0 || place === run.decisions.length - 1);
    kept.forEach((decision) => Object.assign(decision, { scan: Math.max(0, decision.scan) }));
    run.decisions = kept;
    if (labelsOf.get(run)?.size > FORGET) labelsOf.delete(run);
    return dropped;
  }

  function take(frame) {
    if (frame.scene !== run.scene) return location.reload(); // another loop is at this address
    rewind(frame.time);
    Object.assign(run, { utc: frame.utc, extent: frame.extent });
    const values = [frame.time, [], frame.estimates, frame.poses, frame.scans, frame.heights, []];
    values.forEach((value, place) => series[place].push(value));
    if (frame.decision && frame.decision.number !== number) {
      joined(frame.decision, frame.decision.axes);
      run.decisions.push({ ...frame.decision, scan: run.times.length - 1 });
      ({ number } = frame.decision);
    }
    const dropped = forget();
    if (!player) {
      player = startReplay(root);
      player.play(true);
    }
    player.arrived(dropped);
    tellLoop(frame);
  }

  function tellLoop({ health, fit, silence, scans, counts, fault }) {
    part("sensors").replaceChildren(...run.sensors.map(({ name }, s) => {
      const row = element("tr");
      const before = silence[s] === null ? "none yet" : fixed(silence[s], 1);
      row.append(element("th", "", name), element("td", "", before), element("td", "", silence[s] === 0 ? String(scans[s].length) : "no scan"));
      return row;
    }));
    part("health").textContent = health && `Health over the latest scans: ${health}.`;
    part("fit").replaceChildren(...fit.map((line) => element("p", "", `Fit over the latest scans: ${line}.`)));
    part("counts").textContent = Object.entries(counts).map(([name, count]) => `${name}: ${count}`).join(", ");
    part("fault").textContent = fault && `Last line that was not taken: ${fault}`;
  }

  function tellLink() {
    const ago = link.frameAt === null ? "" : `; last news ${Math.round((Date.now() - link.frameAt) / 1000)} s ago`;
    const skipped = link.skipped ? `; ${link.skipped} scans were not drawn, as they came faster` : "";
    const lost = `Disconnected since ${link.since?.toLocaleTimeString()}, tries again: what is shown is old.`;
    part("link").textContent = link.since ? lost : `Connected${ago}${skipped}.`;
    part("link").classList.toggle("lost", link.since !== null);
    root.dataset.connected = link.since === null;
  }

  function connect() {
    const address = new URL(`page${location.search}`, location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(address);
    socket.addEventListener("open", () => {
      link.since = null;
      tellLink();
    });
    socket.addEventListener("message", ({ data }) => {
      const { skipped, frame } = JSON.parse(data);
      Object.assign(link, { skipped, frameAt: Date.now() });
      if (frame) take(frame);
      socket.send("next");
    });
    socket.addEventListener("close", () => {
      link.since ??= new Date();
      tellLink();
      setTimeout(connect, AGAIN);
    });
  }

  setInterval(tellLink, 1000);
  connect();
}

startLive(replay, runs[0]);
