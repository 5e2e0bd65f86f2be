// The runs as tabs, each with its mean error as a bar; beyond a few, a list in their place.
const MOST_TABS = 8;

function tabsOf(holder, list, choose) {
  if (runs.length < 2 || runs.length > MOST_TABS) return () => {};
  list.parentElement.hidden = true;
  holder.hidden = false;
  const most = Math.max(...runs.map(({ mean }) => mean ?? 0));
  const several = new Set(runs.map(({ group }) => group)).size > 1;
  const buttons = runs.map((run, place) => {
    const button = element("button", "tab");
    button.type = "button";
    button.dataset.tab = place;
    const swatch = element("i", "swatch");
    swatch.style.background = `var(--${strategyShade(run)})`;
    const bar = element("i", "bar");
    const known = run.mean !== null && run.mean !== undefined;
    Object.assign(bar.style, { background: swatch.style.background, width: `${known && most > 0 ? (100 * run.mean) / most : 0}%` });
    const error = known ? `${fixed(run.mean, 1)}${run.ospa_unit && ` ${run.ospa_unit}`}` : "";
    const what = [several ? run.group : "", run.words, `run ${run.run}${run.typical ? ", typical" : ""}`].filter(Boolean).join("; ");
    button.title = what;
    button.append(swatch, element("span", "name", run.strategy), element("span", "mean", error), bar, element("span", "about", what));
    button.addEventListener("click", () => choose(place));
    return button;
  });
  holder.replaceChildren(...buttons);
  return (chosen, beside) => buttons.forEach((button, place) => {
    button.setAttribute("aria-pressed", place === chosen);
    button.classList.toggle("beside", place === beside);
  });
}
