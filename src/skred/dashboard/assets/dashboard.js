// One implementation for the server and for the file: they differ in `skredAsk` only, which gives the markup
// and the figures of a view. What follows one event through all views is here, for figures and tables alike.
"use strict";
(function () {
  const catalogue = JSON.parse(document.getElementById("catalogue").textContent);
  const element = (id) => document.getElementById(id);
  const stage = element("stage"), made = new Map();
  let view = null, run = null, chosen = null, turn = 0;

  const entryKeys = new Set(catalogue.entries);
  const viewOf = (id) => catalogue.views.find((one) => one.id === id);
  const runsOf = (id) => catalogue.runs.filter((one) => entryKeys.has(`${id}-${one.key}`));
  const keyOf = () => (viewOf(view).over_all ? view : `${view}-${run}`);
  const exists = (id) => entryKeys.has(id) || runsOf(id).length > 0;

  // ---- views
  async function show() {
    const kind = viewOf(view), runs = runsOf(view), mine = ++turn;
    if (!kind.over_all && !runs.some((one) => one.key === run)) run = runs[0].key;
    element("title").textContent = kind.title;
    element("how").textContent = kind.how;
    element("view").value = view;
    element("run-choice").hidden = kind.over_all || runs.length === 0;
    element("run-choice").style.display = kind.over_all ? "none" : "";
    element("run").replaceChildren(...runs.map((one) => new Option(one.title, one.key, false, one.key === run)));
    for (const button of document.querySelectorAll("nav button")) {
      if (button.dataset.view === view) button.setAttribute("aria-current", "page");
      else button.removeAttribute("aria-current");
    }
    const key = keyOf();
    for (const other of stage.children) other.hidden = other.dataset.key !== key;
    if (!made.has(key)) made.set(key, draw(key, []));  // the promise: a second click waits for the first
    element("wait").hidden = false;
    const section = await made.get(key);
    if (mine !== turn) return;  // a later click shows what it asked for, and hides the word
    element("wait").hidden = true;
    section.hidden = false;
    document.body.dataset.shown = key;
    document.body.dataset.chosen = chosen === null ? "" : chosen;
  }

  async function draw(key, parameters) {
    const section = document.createElement("div");
    section.className = "view";
    section.dataset.key = key;
    stage.append(section);
    await fill(section, key, parameters);
    return section;
  }

  // What is asked last is what a section shows, however the answers come.
  async function fill(section, key, parameters) {
    const mine = section.dataset.turn = String(Number(section.dataset.turn ?? 0) + 1);
    try {
      const answer = await window.skredAsk(key, parameters);
      if (section.dataset.turn !== mine) return;
      section.innerHTML = answer.html;
      for (const item of answer.items) {
        if (section.dataset.turn !== mine) return;
        await Bokeh.embed.embed_item(item);
      }
    } catch (error) {
      section.textContent = `This view did not come: ${error.message}`;
    }
    mark(section);
    marks.watch();
    follow();
  }

  // ---- one event through all views
  function choose(event) {
    chosen = event || null;
    element("event").value = chosen === null ? "" : chosen;
    document.body.classList.toggle("has-event", chosen !== null);
    document.body.dataset.chosen = chosen === null ? "" : chosen;
    for (const section of stage.children) mark(section);
    follow();
  }

  const marks = window.skredMarks((event) => choose(event));

  function follow() {
    marks.follow(chosen);
    for (const one of Bokeh.documents) for (const model of one.all_models) {
      if (model.name === "skred-draws") showDraws(one, model);
    }
  }

  // Draws of the chosen event: all, or the one that the slider of the view says.
  function showDraws(doc, filter) {
    const slider = document.querySelector(`[data-draws="${filter.tags[0]}"]`);
    const which = Number(slider === null ? 0 : slider.value);
    for (const renderer of doc.all_models) {
      if (renderer.type !== "GlyphRenderer" || renderer.view.filter !== filter) continue;
      const data = renderer.data_source.data, draws = Array.from(data.draw), rows = [];
      if (chosen !== null) Array.from(data.of).forEach((one, row) => {
        if (one === chosen && (which === 0 || draws[row] === which - 1)) rows.push(row);
      });
      filter.indices = rows;
    }
  }

  function mark(section) {
    let any = false;
    for (const row of section.querySelectorAll("tr[data-event]")) {
      const same = row.dataset.event === chosen;
      if (row.dataset.only !== undefined) { row.hidden = !same; any = any || same; }
      else row.classList.toggle("chosen", same);
    }
    for (const table of section.querySelectorAll("[data-details]")) table.hidden = !any;
    for (const told of section.querySelectorAll("[data-none]")) {
      told.hidden = any;
      told.textContent = chosen === null ? "Choose an event above, or click a point in any figure."
        : "No run says anything of this event by sensor.";
    }
  }

  // ---- what people do
  element("view").addEventListener("change", (change) => { view = change.target.value; show(); });
  element("run").addEventListener("change", (change) => { run = change.target.value; show(); });
  element("event").addEventListener("change", (change) => choose(change.target.value));
  element("none").addEventListener("click", () => choose(null));
  for (const [id, step] of [["before", -1], ["after", 1]]) element(id).addEventListener("click", () => {
    const n = catalogue.events.length, at = catalogue.events.indexOf(chosen);
    if (n) choose(catalogue.events[at < 0 ? (step > 0 ? 0 : n - 1) : (at + step + n) % n]);
  });
  for (const button of document.querySelectorAll("nav button")) {
    button.disabled = !exists(button.dataset.view);
    button.addEventListener("click", () => { view = button.dataset.view; show(); });
  }
  for (const option of [...element("view").options]) option.disabled = !exists(option.value);
  stage.addEventListener("click", (click) => {
    const row = click.target.closest("tr[data-event]:not([data-only])");
    if (row) choose(row.dataset.event === chosen ? null : row.dataset.event);
    if (click.target.closest("[data-again]")) {
      const section = click.target.closest(".view");
      const wanted = [...section.querySelectorAll("[data-parameter]:checked")].map((one) => one.value);
      fill(section, section.dataset.key, wanted);
    }
  });
  stage.addEventListener("input", (input) => {
    if (input.target.dataset.draws === undefined) return;
    const which = Number(input.target.value);
    input.target.nextElementSibling.textContent = which === 0 ? `all ${input.target.max}` : `number ${which}`;
    follow();
  });

  view = "overview";
  window.skred = { choose, chosen: () => chosen, sources: marks.sources };
  show();
})();
