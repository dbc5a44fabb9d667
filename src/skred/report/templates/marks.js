// Marks of events in figures of bokeh: a tap on one chooses its event, and all marks of the chosen one are selected.
"use strict";
window.skredMarks = (choose) => {
  const watched = new WeakSet();
  let busy = false;
  const sources = () => Bokeh.documents.flatMap((one) => [...one.all_models])
    .filter((one) => one.type === "ColumnDataSource" && one.data.event !== undefined);

  function watch() {
    for (const source of sources()) {
      if (watched.has(source)) continue;
      watched.add(source);
      source.selected.properties.indices.change.connect(() => {
        if (busy) return;
        const [row] = source.selected.indices;
        choose(row === undefined ? null : Array.from(source.data.event)[row]);
      });
    }
  }

  // Rows of the event in every source of every figure; without an event nothing is selected.
  function follow(chosen) {
    busy = true;
    try {
      for (const source of sources()) {
        const rows = [];
        if (chosen !== null) Array.from(source.data.event).forEach((one, row) => { if (one === chosen) rows.push(row); });
        source.selected.indices = rows;
      }
    } finally { busy = false; }
  }
  return { sources, watch, follow };
};
