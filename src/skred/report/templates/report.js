// What a page of skred adds where scripts run: hovering, one avalanche highlighted everywhere, tables that sort.
// Without it everything is there as well: titles in the drawings, numbers in the tables.
"use strict";
(function () {
  const all = (selector, within) => Array.from((within || document).querySelectorAll(selector));
  const make = (tag, words, name) => {
    const made = document.createElement(tag);
    if (words) made.textContent = words;
    if (name) made.className = name;
    return made;
  };
  const body = document.body;
  body.classList.add("live");
  const thing = body.dataset.thing || "avalanche";

  // Hovering: the title of a target, at once and in the page's own style.
  const tip = make("div", "", "tip");
  tip.hidden = true;
  tip.setAttribute("role", "tooltip");
  body.append(tip);
  const marks = all(".mark");
  const words = new Map();
  marks.forEach((mark) => {
    const title = mark.querySelector("title");
    if (!title) return;
    words.set(mark, title.textContent);
    title.remove();
  });
  function show(mark) {
    const box = mark.getBoundingClientRect();
    tip.textContent = words.get(mark);
    tip.hidden = false;
    const wide = document.documentElement.clientWidth, own = tip.getBoundingClientRect();
    const left = Math.min(Math.max(4, box.left + box.width / 2 - own.width / 2), wide - own.width - 4);
    const above = box.top - own.height - 6;
    tip.style.left = (left + window.scrollX) + "px";
    tip.style.top = ((above > 4 ? above : box.bottom + 6) + window.scrollY) + "px";
  }
  document.addEventListener("pointerover", (event) => {
    const mark = event.target.closest && event.target.closest(".mark");
    if (mark && words.has(mark)) show(mark);
    else tip.hidden = true;
  });

  // Highlighting: everything of one avalanche, in all figures and tables.
  const named = all("[data-event]");
  const names = Array.from(new Set(named.map((one) => one.dataset.event)));
  let chosen = null, select = null, told = null, clear = null, bar = null;
  function choose(name) {
    chosen = name === chosen ? null : name;
    document.dispatchEvent(new CustomEvent("skred-chosen", { detail: chosen }));
    if (!bar) return;
    const figures = new Set(), tables = new Set();
    named.forEach((one) => {
      const is = chosen !== null && one.dataset.event === chosen;
      one.classList.toggle("chosen", is);
      const button = one.querySelector("th button");
      if (button) button.setAttribute("aria-pressed", String(is));
      if (!is) return;
      const figure = one.closest("figure"), table = one.closest("table");
      if (figure) figures.add(figure);
      if (table) tables.add(table);
    });
    bar.classList.toggle("on", chosen !== null);
    clear.hidden = chosen === null;
    select.value = chosen === null ? "" : chosen;
    told.textContent = chosen === null ? "" :
      "highlighted in " + figures.size + (figures.size === 1 ? " figure, " : " figures, ") +
      tables.size + (tables.size === 1 ? " table" : " tables");
  }
  if (names.length) {
    bar = make("div", "", "chooser");
    bar.setAttribute("role", "group");
    bar.setAttribute("aria-label", "Highlight one " + thing);
    const label = make("label", "Highlight one " + thing + ": ");
    select = make("select");
    const none = make("option", "none");
    none.value = "";
    select.append(none);
    names.forEach((name) => { const option = make("option", name); option.value = name; select.append(option); });
    label.append(select);
    told = make("span");
    told.setAttribute("role", "status");
    clear = make("button", "Clear");
    clear.type = "button";
    clear.hidden = true;
    bar.append(label, told, clear);
    const nav = document.querySelector("nav");
    (nav ? nav.closest("header") || nav : body.firstElementChild).after(bar);
    select.addEventListener("change", () => choose(select.value === "" ? chosen : select.value));
    clear.addEventListener("click", () => choose(chosen));
    all("tr[data-event] > th:first-child").forEach((head) => {
      const button = make("button");
      button.type = "button";
      button.setAttribute("aria-pressed", "false");
      button.append(...head.childNodes);
      head.append(button);
    });
    document.addEventListener("click", (event) => {
      const one = event.target.closest && event.target.closest(".mark[data-event], tr[data-event] > th button");
      if (one) choose(one.closest("[data-event]").dataset.event);
    });
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && chosen !== null) choose(chosen);
    });
  }

  // For what is drawn later; see explore.js.
  window.skred = { choose: (name) => { if (name !== chosen) choose(name === null ? chosen : name); }, chosen: () => chosen };

  // Sorting: the number that a cell begins with, or else its words.
  function valueOf(row, column) {
    const cell = row.cells[column];
    const text = cell ? cell.textContent.trim() : "";
    const found = text.replace(/\u2212/g, "-").replace(/[\u202f\u00a0](?=\d{3})/g, "")
      .match(/^[<>\u2265+]?\s*([+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?)/);
    return { number: found ? parseFloat(found[1]) : NaN, text: text };
  }
  function sort(table, column, head) {
    const rising = head.getAttribute("aria-sort") === "descending" || !head.hasAttribute("aria-sort");
    const rows = Array.from(table.tBodies[0].rows);
    const keys = new Map(rows.map((row) => [row, valueOf(row, column)]));
    const numbers = rows.filter((row) => !isNaN(keys.get(row).number)).length >= rows.length / 2;
    rows.sort((a, b) => {
      const one = keys.get(a), other = keys.get(b), sign = rising ? 1 : -1;
      if (!numbers) return sign * one.text.localeCompare(other.text);
      if (isNaN(one.number) || isNaN(other.number)) return Number(isNaN(one.number)) - Number(isNaN(other.number));
      return sign * (one.number - other.number);
    });
    all("thead th", table).forEach((one) => one.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", rising ? "ascending" : "descending");
    table.tBodies[0].append(...rows);
  }
  all("table.sortable").forEach((table) => {
    if (!table.tHead || table.tHead.rows.length !== 1 || table.tBodies.length !== 1) return;
    Array.from(table.tHead.rows[0].cells).forEach((head, column) => {
      const button = make("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => sort(table, column, head));
    });
  });

  window.addEventListener("beforeprint", () => all("details").forEach((one) => { one.open = true; }));
})();
