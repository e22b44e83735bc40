"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const root = document.documentElement;

  // Theme: the system's, until the button chooses the other one.
  const darkSystem = window.matchMedia("(prefers-color-scheme: dark)");
  const setTheme = (dark) => {
    root.dataset.theme = dark ? "dark" : "light";
    byId("theme").setAttribute("aria-pressed", String(dark));
    byId("theme").textContent = dark ? "Light" : "Dark";
  };
  setTheme(darkSystem.matches);
  byId("theme").addEventListener("click", () => {
    setTheme(root.dataset.theme !== "dark");
    redraw();
  });
  darkSystem.addEventListener("change", (event) => { setTheme(event.matches); redraw(); });

  const fill = (select, values, words = (value) => value) => {
    const kept = select.value;
    select.replaceChildren(...values.map((value) => new Option(words(value), value)));
    if (values.map(String).includes(kept)) select.value = kept;
  };
  const targetWords = (name) => {
    const { description, unit } = data.targets[name];
    return unit ? `${name} [${unit}]: ${description}` : `${name}: ${description}`;
  };

  // Boards: one of them is shown; headings sort, text filters rows.
  const boards = [...document.querySelectorAll(".board")];
  const showBoard = () => {
    const target = byId("board-target").value;
    const road = byId("board-road").value;
    const sensors = byId("board-sensors").value;
    const text = byId("board-text").value.trim().toLowerCase();
    for (const board of boards) {
      const { dataset } = board;
      board.hidden = dataset.target !== target || dataset.road !== road || dataset.sensors !== sensors;
      if (board.hidden) continue;
      const rows = [...board.querySelectorAll("tbody tr")];
      for (const row of rows) row.hidden = !row.textContent.toLowerCase().includes(text);
      const methods = rows.filter((row) => row.closest(".narrow"));
      const shown = methods.filter((row) => !row.hidden).length;
      byId("board-status").textContent = `${shown} of ${methods.length} methods shown`;
    }
  };
  const of = (key, chosen) => [...new Set(boards.map((board) => board.dataset)
    .filter((one) => Object.entries(chosen).every(([name, value]) => one[name] === value))
    .map((one) => one[key]))];
  const chooseRoad = () => {
    const target = byId("board-target").value;
    fill(byId("board-sensors"), of("sensors", { target, road: byId("board-road").value }));
    showBoard();
  };
  const chooseTarget = () => {
    const target = byId("board-target").value;
    fill(byId("board-road"), of("road", { target }), (road) => road || "every road");
    chooseRoad();
  };
  const key = (cell) => {
    const value = cell.dataset.value;
    if (value !== undefined) return Number(value);
    const text = cell.textContent.trim();
    return text === "–" || text === "" ? null : text;
  };
  const sortTable = (heading) => {
    const table = heading.closest("table");
    const column = heading.cellIndex;
    const falling = heading.getAttribute("aria-sort") === "ascending";
    table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", falling ? "descending" : "ascending");
    for (const body of table.tBodies) {
      const rows = [...body.rows].map((row) => [key(row.cells[column]), row]);
      rows.sort(([a], [b]) => {
        if (a === null || b === null) return (a === null) - (b === null); // missing comes last
        const order = typeof a === "number" && typeof b === "number"
          ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
        return falling ? -order : order;
      });
      body.append(...rows.map(([, row]) => row));
    }
  };
  for (const heading of document.querySelectorAll("table.gripbench thead th")) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = heading.textContent;
    button.addEventListener("click", () => sortTable(heading));
    heading.replaceChildren(button);
  }
  for (const table of document.querySelectorAll("table.gripbench")) { // names stay in sight when it scrolls
    const column = [...table.tHead.rows[0].cells].findIndex((cell) => cell.textContent === "Method");
    if (column < 0) continue;
    for (const row of table.querySelectorAll("thead tr, tbody tr")) row.cells[column].classList.add("name");
  }
  for (const cell of document.querySelectorAll("table.gripbench td")) {
    if (cell.textContent.length > 60) cell.classList.add("long");
  }
  if (boards.length) {
    fill(byId("board-target"), of("target", {}), targetWords);
    byId("board-target").addEventListener("change", chooseTarget);
    byId("board-road").addEventListener("change", chooseRoad);
    byId("board-sensors").addEventListener("change", showBoard);
    byId("board-text").addEventListener("input", showBoard);
    chooseTarget();
  }
  // Answers: the road and the sensors that one has.
  const answers = [...document.querySelectorAll("#answers tbody tr")];
  if (answers.length) {
    const cells = (name) => answers.map((row) => row.querySelector(`[data-key="${name}"]`).textContent.trim());
    const one = (name, every) => { fill(byId(`answer-${name}`), [every, ...new Set(cells(name))]); };
    one("target", "every target"); one("road", "every road"); one("sensors", "any sensors");
    const filter = () => {
      const wanted = ["target", "road", "sensors"].map((name) => [cells(name), byId(`answer-${name}`)]);
      answers.forEach((row, i) => {
        row.hidden = !wanted.every(([texts, select]) => select.selectedIndex === 0 || texts[i] === select.value);
      });
    };
    for (const name of ["target", "road", "sensors"]) byId(`answer-${name}`).addEventListener("change", filter);
  }
  for (const form of document.querySelectorAll("form")) {
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  // Verdicts of papers.
  const verdicts = { match: "good", reproduced: "good", mismatch: "bad", "not reproduced": "bad" };
  for (const cell of document.querySelectorAll(".papers td")) {
    const kind = verdicts[cell.textContent.trim()];
    if (kind) cell.classList.add(kind);
  }

  // Plots.
  const unpack = (series) => {
    const bytes = Uint8Array.from(atob(series.data), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Array.from({ length: bytes.length / 2 }, (_, index) => {
      const number = view.getUint16(2 * index, true);
      return number === 65535 ? null : series.low + series.step * number;
    });
  };
  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const look = (index) => {
    const { light, dark, dashes, symbols } = data.style;
    const turn = Math.floor(index / light.length);
    return {
      color: (root.dataset.theme === "dark" ? dark : light)[index % light.length],
      dash: dashes[(index + turn) % dashes.length],
      symbol: symbols[(index + turn) % symbols.length],
    };
  };
  const layout = (more) => ({
    paper_bgcolor: colour("--background"),
    plot_bgcolor: colour("--background"),
    font: { color: colour("--text"), family: getComputedStyle(document.body).fontFamily, size: 13 },
    margin: { l: 70, r: 45, t: 10, b: 50 },
    modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: colour("--muted") }, // beside plot and legend
    hoverlabel: { bgcolor: colour("--surface"), font: { color: colour("--text") } },
    ...more,
  });
  const axis = (title, more) => ({
    title: { text: title }, gridcolor: colour("--line"), linecolor: colour("--muted"),
    zerolinecolor: colour("--muted"), automargin: true, ...more,
  });
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
  const ticks = (values) => { // 1, 2, 5 of each decade that the values touch
    const first = Math.floor(Math.log10(Math.min(...values)));
    const last = Math.ceil(Math.log10(Math.max(...values)));
    const places = [];
    for (let power = first; power <= last; power += 1) places.push(...[1, 2, 5].map((n) => n * 10 ** power));
    return { tickvals: places, ticktext: places.map((place) => String(Number(place.toPrecision(3)))) };
  };
  const react = (id, traces, shape) => window.Plotly.react(id, traces, shape, config);

  const drawMap = () => {
    const target = byId("map-target").value;
    const whole = data.maps[target];
    fill(byId("map-road"), ["every road", ...new Set(whole.roads)]);
    const road = byId("map-road").value;
    const kept = whole.scenarios.map((_, j) => j).filter((j) => road === "every road" || whole.roads[j] === road);
    const of = (rows) => rows.map((row) => kept.map((j) => row[j]));
    const map = { methods: whole.methods, scenarios: kept.map((j) => whole.scenarios[j]), ratio: of(whole.ratio), text: of(whole.text) };
    const top = 30; // ratios beyond this are all equally bad
    const z = map.ratio.map((row) => row.map((value) =>
      value === null ? null : Math.log10(Math.min(Math.max(value, 1), top))));
    byId("map-plot").style.height = `${Math.max(16, 9 + 2.2 * map.methods.length)}rem`;
    byId("map-plot").style.minWidth = `${27 + 4.2 * map.scenarios.length}rem`;
    const names = map.scenarios.map((name) => name.replaceAll("_", " "));
    const words = { x: [], y: [], text: [], color: [] };
    map.text.forEach((row, i) => row.forEach((text, j) => {
      words.x.push(names[j]); words.y.push(map.methods[i]); words.text.push(text);
      words.color.push(z[i][j] === null ? colour("--muted") : z[i][j] < 0.45 * Math.log10(top) ? "#ffffff" : "#000000");
    }));
    react("map-plot", [{
      type: "heatmap", x: names, y: map.methods, z, text: map.text,
      customdata: map.ratio, colorscale: "Cividis", zmin: 0, zmax: Math.log10(top), xgap: 2, ygap: 2,
      hovertemplate: "%{y}<br>%{x}<br>RMS %{text}<br>%{customdata:.3g} times the best<extra></extra>",
      hoverongaps: false,
      colorbar: { title: { text: "× best" }, tickvals: [0, Math.log10(2), Math.log10(5), 1, Math.log10(top)],
        ticktext: ["1", "2", "5", "10", "30+"], outlinewidth: 0 },
    }, {
      type: "scatter", mode: "text", x: words.x, y: words.y, text: words.text,
      textfont: { color: words.color, size: 12 }, hoverinfo: "skip", showlegend: false,
    }], layout({
      xaxis: axis("", { side: "top", tickangle: -30, showgrid: false }),
      yaxis: axis("", { autorange: "reversed", showgrid: false }),
      modebar: { orientation: "h", bgcolor: "rgba(0,0,0,0)", color: colour("--muted") }, // above the colour bar
    }));
  };

  const seriesOf = () => data.series[byId("series-scenario").value];
  const order = (label) => data.methods.indexOf(label);
  const checked = new Set();
  const chooseScenario = () => {
    fill(byId("series-target"), Object.keys(seriesOf().truth), targetWords);
    fill(byId("series-seed"), seriesOf().seeds, (seed) => {
      const window_ = seriesOf().windows[seed];
      return window_ ? `${seed}: run ${window_.run}, ${window_.start.toFixed(2)} to ${window_.end.toFixed(2)} s` : seed;
    });
    byId("series-from").value = byId("series-to").value = "";
    chooseMethods();
  };
  const chooseMethods = () => {
    const labels = Object.keys(seriesOf().estimates[byId("series-target").value] ?? {})
      .sort((a, b) => order(a) - order(b));
    if (!labels.some((label) => checked.has(label))) labels.slice(0, 3).forEach((label) => checked.add(label));
    byId("series-methods").replaceChildren(...labels.map((label) => {
      const box = document.createElement("input");
      box.type = "checkbox"; box.value = label; box.checked = checked.has(label);
      box.addEventListener("change", () => {
        if (box.checked) checked.add(label); else checked.delete(label);
        drawSeries();
      });
      const words = document.createElement("label");
      words.append(box, " ", label);
      return words;
    }));
    drawSeries();
  };
  const drawSeries = () => {
    if (!window.Plotly) return;
    const content = seriesOf();
    const target = byId("series-target").value;
    const seed = byId("series-seed").value;
    const { unit, turn } = data.targets[target];
    const difference = (value, true_) => (turn ? value - true_ - turn * Math.round((value - true_) / turn) : value - true_);
    const window_ = content.windows[seed];
    const time = unpack(content.time).map((t) => t + (window_ ? window_.start : 0));
    const truth = unpack(content.truth[target][seed]);
    byId("series-band").textContent = content.band_seeds || "no";
    const traces = [{ x: time, y: truth, name: "Truth", mode: "lines", line: { color: colour("--text"), width: 4 } }];
    for (const [label, seeds] of Object.entries(content.estimates[target] ?? {})) {
      if (!checked.has(label) || !seeds[seed]) continue;
      const values = unpack(seeds[seed]);
      const { color, dash } = look(order(label));
      const line = { color, dash, width: 2 };
      const [low, , high] = content.bands[target]?.[label]?.map(unpack) ?? [];
      traces.push({ x: time, y: values, name: label, mode: "lines", line, legendgroup: label });
      if (low) {
        traces.push(
          { x: time, y: low, yaxis: "y2", mode: "lines", line: { width: 0 }, showlegend: false,
            hoverinfo: "skip", legendgroup: label },
          { x: time, y: high, yaxis: "y2", mode: "lines", line: { width: 0 }, fill: "tonexty",
            fillcolor: color + "33", showlegend: false, hoverinfo: "skip", legendgroup: label });
      }
      traces.push({ x: time, y: values.map((value, k) => value === null || truth[k] === null ? null : difference(value, truth[k])),
        yaxis: "y2", name: label, mode: "lines", line, showlegend: false, legendgroup: label });
    }
    const from = byId("series-from").valueAsNumber;
    const to = byId("series-to").valueAsNumber;
    const range = [Number.isNaN(from) ? time[0] : from, Number.isNaN(to) ? time[time.length - 1] : to];
    const title = (words) => (unit ? `${words} [${unit}]` : words);
    react("series-plot", traces, layout({
      xaxis: axis(window_ ? "Time of the log [s]" : "Time [s]", { anchor: "y2", range }),
      yaxis: axis(title(target), { domain: [0.44, 1] }),
      yaxis2: axis(title("error"), { domain: [0, 0.38] }),
      legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
      margin: { l: 70, r: 45, t: 70, b: 50 },
      hovermode: "x unified", dragmode: "zoom",
      uirevision: [byId("series-scenario").value, target].join(),
    }));
  };

  const drawFront = () => {
    const target = byId("front-target").value;
    const points = data.fronts[target];
    const best = points.filter((point) => point.front).sort((a, b) => a.step - b.step);
    const narrow = byId("front-plot").clientWidth < 640;
    byId("front-plot").style.height = `${narrow ? 22 + 1.3 * points.length : 28 + 0.5 * points.length}rem`;
    const traces = [{
      x: best.map((point) => point.step), y: best.map((point) => point.score), mode: "lines",
      line: { color: colour("--muted"), dash: "dot", shape: "hv" }, name: "Pareto front", hoverinfo: "skip",
    }];
    for (const point of points) {
      const { color, symbol } = look(order(point.label));
      traces.push({
        x: [point.step], y: [point.score], name: point.label, mode: "markers",
        marker: { color, symbol: point.front ? symbol : `${symbol}-open`, size: 12, line: { width: 2, color } },
        hovertemplate: `${point.label}<br>score %{y:.3g}<br>%{x:.3g} ns a step<br>reads ${point.reads}<extra></extra>`,
      });
    }
    react("front-plot", traces, layout({
      xaxis: axis("Time of a step [ns]", { type: "log", ...ticks(points.map((point) => point.step)) }),
      yaxis: axis("Score (1 is typical)", { type: "log", ...ticks(points.map((point) => point.score)) }),
      legend: { orientation: "h", y: -0.2, yanchor: "top", ...(narrow ? { entrywidth: 1, entrywidthmode: "fraction" } : {}) },
    }));
  };

  const drawProfile = () => {
    const { factors, methods } = data.profiles[byId("profile-target").value];
    const traces = Object.entries(methods).map(([label, shares]) => {
      const { color, dash } = look(order(label));
      return { x: factors, y: shares, name: label, mode: "lines", line: { color, dash, width: 2, shape: "hv" },
        hovertemplate: `${label}<br>within %{x:.3g} of the best in %{y:.0%}<extra></extra>` };
    });
    react("profile-plot", traces, layout({
      xaxis: axis("Factor to the best method of a drive", { type: "log", ...ticks(factors) }),
      yaxis: axis("Share of drives", { range: [0, 1.02], tickformat: ".0%" }),
      legend: { orientation: "h", y: -0.2, yanchor: "top" },
    }));
    document.querySelectorAll(".critical").forEach((item) => { item.hidden = item.dataset.target !== byId("profile-target").value; });
  };

  const drawers = new Map();
  const drawn = new Set();
  if (Object.keys(data.maps).length) {
    fill(byId("map-target"), Object.keys(data.maps), targetWords);
    drawers.set("map-plot", drawMap);
    byId("map-target").addEventListener("change", drawMap);
    byId("map-road").addEventListener("change", drawMap);
  }
  if (Object.keys(data.series).length) {
    fill(byId("series-scenario"), Object.keys(data.series), (name) => name.replaceAll("_", " "));
    chooseScenario();
    drawers.set("series-plot", drawSeries);
    byId("series-scenario").addEventListener("change", chooseScenario);
    byId("series-target").addEventListener("change", chooseMethods);
    byId("series-seed").addEventListener("change", drawSeries);
    byId("series-from").addEventListener("change", drawSeries);
    byId("series-to").addEventListener("change", drawSeries);
    byId("series-all").addEventListener("click", () => {
      byId("series-from").value = byId("series-to").value = "";
      window.Plotly.relayout("series-plot", { "xaxis.autorange": true, "yaxis.autorange": true, "yaxis2.autorange": true });
    });
  }
  if (Object.keys(data.fronts).length) {
    fill(byId("front-target"), Object.keys(data.fronts), targetWords);
    drawers.set("front-plot", drawFront);
    byId("front-target").addEventListener("change", drawFront);
  }
  if (Object.keys(data.profiles).length) {
    fill(byId("profile-target"), Object.keys(data.profiles), targetWords);
    drawers.set("profile-plot", drawProfile);
    byId("profile-target").addEventListener("change", drawProfile);
  }
  const redraw = () => drawn.forEach((id) => drawers.get(id)());
  window.gripbenchReport = {
    draw() { // a plot is drawn when it comes near the window, so that the page is usable at once
      const watch = new IntersectionObserver((entries) => {
        for (const { isIntersecting, target } of entries) {
          if (!isIntersecting) continue;
          watch.unobserve(target);
          drawn.add(target.id);
          drawers.get(target.id)();
        }
      }, { rootMargin: "400px" });
      drawers.forEach((_, id) => watch.observe(byId(id)));
    },
  };
})();
