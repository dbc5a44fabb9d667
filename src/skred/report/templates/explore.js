// Figures of ArviZ in place of the drawings, where one asks for them. Bokeh, which draws them, is unpacked and started
// then: a page that nobody explores opens as fast as without it. On paper the drawings stand.
"use strict";
(function () {
  if (!window.DecompressionStream) return;  // an old browser: the drawings stand alone
  const EXPLORE = "Explore with ArviZ", BACK = "Back to the drawing";
  const make = (tag, name, words) => {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (words) made.textContent = words;
    return made;
  };
  const night = window.matchMedia("(prefers-color-scheme: dark)"), open = new Set();
  let started = null, marks = null;

  function start() {
    if (started === null) started = (async () => {
      const program = make("script");
      program.textContent = await window.skredUnpack(document.getElementById("bokeh").textContent);
      document.body.append(program);  // the page's policy knows it by its digest
      if (!window.Bokeh) throw new Error("bokeh did not start");
      Bokeh.logger.set_level("warn");
      marks = window.skredMarks(window.skred.choose);
      window.skred.sources = marks.sources;
    })();
    return started;
  }

  // Colours are variables of the page's style, which knows what they are in the light and in the dark.
  function coloured(text) {
    const style = getComputedStyle(document.documentElement);
    return text.replace(/var\((--c[0-9a-f]{6})\)/g, (whole, name) => style.getPropertyValue(name).trim() || `#${name.slice(3)}`);
  }

  function panelOf(panel) {
    const section = make("div", panel.wide ? "panel whole" : "panel"), title = make("p", "panel-title", panel.title);
    const place = make("div", "place");
    section.setAttribute("role", "group");
    section.setAttribute("aria-label", panel.title);
    section.append(title, place);
    if (panel.note) section.append(make("p", "note", panel.note));
    return { section, place };
  }

  async function fill(one) {
    const turn = one.turn = (one.turn || 0) + 1;
    const plots = JSON.parse(coloured(await window.skredUnpack(one.data)));
    if (turn !== one.turn) return;
    clear(one);
    for (const { plot, how, panels } of plots) {
      const grid = make("div", "panels");
      one.place.append(make("p", "note", `ArviZ's ${plot}. ${how}`), grid);
      for (const panel of panels) {
        const { section, place } = panelOf(panel);
        grid.append(section);
        one.views.push(await Bokeh.embed.embed_item(panel.item, place));
        if (turn !== one.turn) return;
      }
    }
    one.place.append(make("p", "note", "Tools to move, zoom and save a figure appear where you point at it."));
    marks.watch();
    marks.follow(window.skred.chosen());
  }

  function clear(one) {
    for (const view of one.views) view.clear();
    one.views = [];
    one.place.replaceChildren();
  }

  async function toggle(one) {
    const opens = !open.has(one);
    if (opens) open.add(one); else open.delete(one);
    one.button.textContent = opens ? BACK : EXPLORE;
    one.place.hidden = !opens;
    one.figure.classList.toggle("exploring", opens && one.views.length > 0);
    if (!opens || one.views.length) return;
    one.told.textContent = "Drawing…";
    try {
      await start();
      await fill(one);
      one.told.textContent = "";
      one.figure.classList.toggle("exploring", open.has(one));
    } catch (error) {
      clear(one);
      if (open.has(one)) toggle(one);
      one.told.textContent = `Could not be drawn here: ${error.message}`;
    }
  }

  for (const block of document.querySelectorAll("script.exploration-data")) {
    const figure = block.closest("figure");
    const one = { data: block.textContent, figure, views: [], place: make("div", "exploration"),
                  button: make("button", "explore", EXPLORE), told: make("span", "note") };
    const row = make("div", "explore-row");
    one.button.type = "button";
    const drawing = figure.querySelector("svg");
    one.told.setAttribute("role", "status");
    one.place.hidden = true;
    one.place.setAttribute("role", "group");
    one.place.setAttribute("aria-label", `To explore: ${drawing ? drawing.getAttribute("aria-label") : ""}`);
    row.append(one.button, one.told);
    block.after(one.place, row);
    one.button.addEventListener("click", () => toggle(one));
  }

  document.addEventListener("skred-chosen", (event) => { if (marks) marks.follow(event.detail); });
  night.addEventListener("change", () => { for (const one of open) if (one.views.length) fill(one); });
})();
