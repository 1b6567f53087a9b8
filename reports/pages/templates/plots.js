// Plots: drawn when they come near the screen, coloured by the theme, one cursor and one zoom over those that share time.
(() => {
  const PAPER = 680; // width of a plot in print, pixels
  const charts = new Map(); // those that are drawn
  const begun = new Map();
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const axes = (layout) => Object.keys(layout).filter((key) => /^[xy]axis\d*$/.test(key));
  const scheme = (layout) => {
    const out = {
      paper_bgcolor: colour("--paper"), plot_bgcolor: colour("--paper"), "font.color": colour("--ink"),
      "modebar.color": colour("--soft"), "modebar.activecolor": colour("--ink"), "modebar.bgcolor": "rgba(0,0,0,0)",
    };
    for (const key of axes(layout)) {
      for (const part of ["gridcolor", "linecolor", "zerolinecolor"]) out[`${key}.${part}`] = colour("--line");
    }
    return out;
  };
  const options = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d", "sendChartToCloud"] };
  const themed = (layout) => {
    const out = structuredClone(layout);
    for (const [path, value] of Object.entries(scheme(layout))) {
      const keys = path.split(".");
      const last = keys.pop();
      let at = out;
      for (const key of keys) at = at[key] ??= {};
      at[last] = value;
    }
    for (const key of axes(out)) if (key[0] === "y") out[key] = { ...out[key], automargin: true }; // titles beside long ticks
    out.legend = { ...out.legend, tracegroupgap: 0 };
    if (innerWidth < 600) {
      out.margin = { ...out.margin, l: 58, r: 6, t: out.showlegend === false ? (out.annotations?.length ? 24 : 10) : out.margin.t }; // no buttons there
      out.font = { ...out.font, size: 10 };
      for (const key of axes(out)) {
        if (key[0] === "x" && out[key].type === "log") out[key] = { ...out[key], nticks: Math.min(6, out[key].nticks ?? 6) };
        if (key[0] === "y") out[key].title = { ...out[key].title, standoff: 4 };
      }
    }
    return out;
  };
  // Lines over time, or over lags, are named at their ends, to the right of their plots, and marks of a cloud beside the
  // last of each engine; on a narrow screen, below the title.
  const [NARROW, TALL, ROOM] = [560, 12, 12]; // width of such a screen, height of a name, width of what leads to it, pixels
  const [SAME, ROWS] = [2.5, 3]; // how near lines end that nobody tells apart, pixels, and rows that their names may take
  const STROKES = { dash: "7 4", dot: "2 3", dashdot: "7 3 2 3" };
  const SVG = Object.assign(document.createElement("div"), { innerHTML: "<svg></svg>" }).firstChild.namespaceURI;
  const drawing = (kind, given, ...inside) => {
    const made = document.createElementNS(SVG, kind);
    Object.entries(given).forEach(([key, value]) => made.setAttribute(key, value));
    made.append(...inside);
    return made;
  };
  const own = (line) => line.name && (line.line || line.mode === "markers") && !line.fill && line.type !== "bar" && line.visible !== false;
  const last = ({ x, y }, high = Infinity) => {
    let i = x.length - 1;
    while (i >= 0 && !(x[i] <= high && Number.isFinite(y[i]))) i -= 1;
    return i;
  };
  const plainly = (line) => line.name.replaceAll("&lt;", "<");
  const entitle = (lines) => { // one that ends before the others says when
    const ends = lines.map((line) => line.x[last(line)]);
    const end = Math.max(...ends.filter(Number.isFinite));
    lines.forEach((line, i) => {
      line.title = plainly(line) + (ends[i] < 0.99 * end ? ` until ${Number(ends[i].toPrecision(3))} s` : "");
    });
  };
  const below = (box, lines) => {
    const key = document.createElement("p");
    key.className = "curves";
    key.setAttribute("aria-hidden", "true"); // the buttons on top say the same
    new Map(lines.map((line) => [line.name, line])).forEach(({ name, meta, line: { color, dash } }) => {
      const one = document.createElement("span");
      one.dataset.line = meta;
      one.hidden = !crossbody.shown(meta);
      const mark = drawing("path", { d: "M0 3H20", stroke: color, "stroke-dasharray": STROKES[dash] || "none" });
      one.append(drawing("svg", { width: 20, height: 6 }, mark), name.replaceAll("&lt;", "<"));
      key.append(one);
    });
    box.before(key);
  };
  const pen = document.createElement("canvas").getContext("2d");
  const named = (box, { data, layout }) => {
    const lines = data.filter(own);
    const timed = box.hasAttribute("data-time");
    const wide = box.clientWidth >= NARROW;
    pen.font = "11px system-ui, sans-serif";
    const room = (text) => ROOM + Math.ceil(pen.measureText(text).width);
    const leave = (texts) => { layout.margin = { ...layout.margin, r: Math.min(Math.max(...texts.map(room)) + 8, 0.4 * box.clientWidth) }; };
    const engines = [...box.closest("[data-page]").querySelectorAll("[data-show]")].map((each) => `${each.dataset.show} until 0.555 s`);
    if (timed && wide && engines.length) leave(engines); // one instant is at one place in all figures of a page
    if (!lines.length) return null;
    if (!timed && !layout.meta) { // lines in a plane end anywhere, often on each other
      const known = lines.filter(({ meta }) => meta);
      if (layout.showlegend === false && known.length) below(box, known);
      return null;
    }
    if (timed) entitle(lines);
    else lines.forEach((line) => { line.title = plainly(line); });
    const over = drawing("svg", { class: "names", "aria-hidden": "true" });
    const marks = layout.meta === "marks";
    if (!wide && !(marks && layout.showlegend === false)) {
      if (layout.showlegend === false) below(box, lines); // others have a legend
      return over;
    }
    over.dataset.named = layout.meta || "ends";
    lines.forEach((line) => Object.assign(line, { showlegend: false, wide: room(line.title) }));
    if (!marks && !(timed && engines.length)) leave(lines.map(({ title }) => title));
    return over;
  };
  // Where a line leaves its plot, pixels; nothing where it is not seen.
  const left = (line, x, y) => {
    const [low, high] = x.type === "log" ? x.range.map((end) => 10 ** end) : x.range;
    const i = last(line, high);
    if (i < 0) return null;
    const to = (value) => Math.min(Math.max(y.d2p(value), 0), y._length);
    const [t, next] = [line.x[i], line.x[i + 1]];
    if (line.mode !== "markers" && next > high && Number.isFinite(line.y[i + 1])) {
      return [x._length, to(line.y[i]) + (high - t) / (next - t) * (to(line.y[i + 1]) - to(line.y[i]))];
    }
    return t < low ? null : [x.d2p(t), to(line.y[i])];
  };
  // Middles of names, as near to those wanted as they may be without an overlap: the mean of those that meet stays.
  const spread = (wanted, most) => {
    const each = Math.min(TALL, most / wanted.length);
    const top = ([middle, count]) => Math.min(Math.max(middle - count * each / 2, 0), most - count * each);
    const groups = [];
    wanted.forEach((height) => {
      groups.push([height, 1]);
      while (groups.length > 1 && top(groups.at(-2)) + groups.at(-2)[1] * each > top(groups.at(-1))) {
        const [[a, m], [b, n]] = groups.splice(-2);
        groups.push([(m * a + n * b) / (m + n), m + n]);
      }
    });
    return groups.flatMap((group) => Array.from({ length: group[1] }, (_, k) => top(group) + (k + 0.5) * each));
  };
  // Names of lines that end together, in rows that have room, each in its colour; of very many, how many there are.
  const rows = (group, most) => {
    const found = [];
    pen.font = "11px system-ui, sans-serif";
    for (const [line] of group) {
      const longer = [...(found.at(-1) || []), line];
      if (found.length && pen.measureText(longer.map(({ title }) => title).join(", ")).width <= most) found[found.length - 1] = longer;
      else found.push([line]);
    }
    if (group.length < 2 || found.length <= ROWS) return found.map((some) => some.map((line) => [line.title, (line.line || line.marker).color]));
    const others = group.filter(([{ title }]) => title !== "truth").length;
    const kind = group.every(([{ meta }]) => meta) ? "engines" : "lines";
    return [[[others < group.length ? `truth and ${others} ${kind}` : `${others} ${kind}`, "var(--ink)"]]];
  };
  const together = (ends) => {
    const groups = [];
    for (const one of ends) {
      const group = groups.find(([[, at]]) => Math.abs(at[0] - one[1][0]) <= SAME && Math.abs(at[1] - one[1][1]) <= SAME);
      if (group) group.push(one);
      else groups.push([one]);
    }
    return groups;
  };
  const beside = (over, groups, [x, y, right], room) => {
    const told = groups.flatMap((group) => rows(group, room).map((row, k) => ({ group, row, k })));
    spread(told.map(({ group }) => group[0][1][1]), y._length).forEach((middle, i) => {
      const { group, row, k } = told[i];
      const [line, at] = group[0];
      const height = y._offset + middle;
      const text = drawing("text", { x: right + ROOM + 3, y: height + 4 });
      row.forEach(([title, color], j) => {
        const part = drawing("tspan", {}, title);
        part.style.setProperty("--of", color);
        text.append(...(j ? [", ", part] : [part]));
      });
      if (!k) {
        over.append(drawing("path", { d: `M${x._offset + at[0]} ${y._offset + at[1]}L${right + ROOM} ${height}`, stroke: line.line.color }));
        text.dataset.all = group.map(([{ title }]) => title).join("|");
      }
      over.append(text);
    });
  };
  const name = (box) => {
    const { over } = charts.get(box);
    const all = box._fullLayout;
    over.replaceChildren();
    for (const key of new Set(box.data.map((line) => line.yaxis || "y"))) {
      const y = all[key.replace("y", "yaxis")];
      const x = all[y.anchor.replace("x", "xaxis")];
      const right = x._offset + x._length;
      const limits = (all.shapes || []).filter(({ yref, name: text }) => text && yref === key).map((shape) => [shape.name, y.d2p(shape.y0)])
        .filter(([, at]) => at >= 0 && at <= y._length).sort(([, a], [, b]) => a - b);
      spread(limits.map(([, at]) => at + TALL / 2), y._length + TALL).forEach((middle, k) => { // above the line, also of the highest
        over.append(drawing("text", { class: "limit", x: right - 3, y: y._offset + middle - TALL + 3 }, limits[k][0]));
      });
      if (!over.dataset.named) continue;
      const inside = over.dataset.named === "marks";
      const lines = box.data.filter((line) => own(line) && (line.yaxis || "y") === key);
      const ends = lines.map((line) => [line, left(line, x, y)]).filter(([, at]) => at).sort(([, a], [, b]) => a[1] - b[1]);
      const points = inside ? lines.flatMap((one) => [...one.x].map((at, i) => [x.d2p(at), y.d2p(one.y[i])])) : [];
      const covered = (at, height, wide, side) => { // marks under a name on one side of its own; infinitely many where it has no room
        const [from, to] = [at + 2 * side, at + side * (wide + ROOM)].sort((a, b) => a - b);
        if (from < 0 || to - ROOM > x._length) return Infinity;
        return points.filter(([px, py]) => px > from && px < to && Math.abs(py - height) < TALL - 3).length;
      };
      if (!inside) {
        beside(over, together(ends), [x, y, right], all.width - right - ROOM - 6);
        continue;
      }
      const heights = spread(ends.map(([, at]) => at[1]), y._length);
      const alone = (height, k) => heights.every((other, j) => j === k || Math.abs(other - height) >= TALL);
      heights.forEach((middle, k) => {
        const [{ title, wide, line, marker }, at] = ends[k];
        const { color } = line || marker;
        // On the side, and if need be a line above or below, where it lies over the fewest marks.
        const lifts = [0, -TALL, TALL].filter((lift) => !lift || alone(middle + lift, k));
        const places = lifts.flatMap((lift) => [[1, lift], [-1, lift]]).map(([side, lift]) => [side, lift, covered(at[0], middle + lift, wide, side)]);
        const [side, lift] = places.reduce((best, one) => (one[2] < best[2] ? one : best));
        heights[k] = middle + lift;
        const [there, height] = [x._offset + at[0] + side * ROOM, y._offset + heights[k]];
        const text = drawing("text", { x: there + 3 * side, y: height + 4, "text-anchor": side < 0 ? "end" : "start" }, title);
        text.setAttribute("class", "inside");
        text.style.setProperty("--of", color);
        over.append(drawing("path", { d: `M${x._offset + at[0]} ${y._offset + at[1]}L${there} ${height}`, stroke: color }), text);
      });
    }
  };
  // How far lines may be from one, around it: an outline a stretch without gaps.
  const around = (line) => (line.band || []).map((half) => {
    const [x, y] = [[], []];
    const put = (at, side) => { x.push(line.x[at]); y.push(line.y[at] + side); };
    for (let [from, i] = [0, 0]; i <= line.y.length; i += 1) {
      if (Number.isFinite(line.y[i])) continue;
      for (let k = from; k < i; k += 1) put(k, half);
      for (let k = i - 1; k >= from; k -= 1) put(k, -half);
      if (i > from) put(i, NaN);
      from = i + 1;
    }
    const { meta, xaxis, yaxis } = line;
    return { type: "scatter", mode: "lines", x, y, meta, xaxis, yaxis, line: { width: 0 }, fill: "toself", fillcolor: "rgba(136,136,136,.3)", hoverinfo: "skip" };
  });
  const visible = (data) => data.map((trace) => (trace.meta && !crossbody.shown(trace.meta) ? false : true));

  let busy = false;
  const zoom = (from, update) => {
    if (busy || !from.hasAttribute("data-time")) return;
    const key = Object.keys(update).find((name) => /^xaxis\d*\.(range|autorange)/.test(name));
    if (!key) return;
    const axis = key.split(".")[0];
    const wide = key.endsWith("autorange");
    const range = update[`${axis}.range`] || [update[`${axis}.range[0]`], update[`${axis}.range[1]`]];
    busy = true;
    const others = [...charts].filter(([box]) => box !== from && box.hasAttribute("data-time")
      && box.closest("[data-page]") === from.closest("[data-page]"));
    Promise.all(others.map(([box]) => Plotly.relayout(box, wide ? (box.dataset.range ? { "xaxis.range": JSON.parse(box.dataset.range) } : { "xaxis.autorange": true }) : { "xaxis.range": range })))
      .finally(() => { busy = false; });
  };
  const cursor = (box, t) => {
    const { mark } = charts.get(box);
    const axis = box._fullLayout && box._fullLayout.xaxis;
    if (!axis || !box.hasAttribute("data-time")) return;
    const x = axis.l2p(t);
    mark.style.visibility = x >= 0 && x <= axis._length ? "visible" : "hidden";
    mark.style.transform = `translateX(${axis._offset + x}px)`;
  };
  const near = new Set(); // those on the screen; told by an observer, for who asks has the page laid out
  const sight = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) near.add(target);
      else near.delete(target);
    }
    marks();
  });

  // Columns of plots do not fit a narrow screen: there they stand below each other, each with its own title and ticks.
  const stacked = (box, { layout }) => {
    const pairs = axes(layout).filter((key) => key[0] === "x").map((key) => [layout[key], layout[`yaxis${(layout[key].anchor ?? "y").slice(1)}`]]);
    if (box.clientWidth > 600 || !pairs.some(([x]) => x.domain?.[0] > 0)) return;
    const over = ([x, y]) => (layout.annotations ?? []).filter((head) => head.xref === "paper" && Math.abs(head.y - y.domain[1]) < 1e-9
      && x.domain[0] < head.x && head.x < x.domain[1]);
    const heads = pairs.map(over);
    const tall = layout.height / new Set(pairs.map(([, y]) => y.domain[1])).size;
    layout.height = tall * pairs.length;
    pairs.forEach(([x, y], i) => {
      const top = 1 - i / pairs.length;
      [x.domain, y.domain, x.showticklabels] = [[0, 1], [top - 1 / pairs.length + (i < pairs.length - 1 ? 80 / layout.height : 0), top], true];
      heads[i].forEach((head) => { [head.x, head.y] = [0.5, top]; });
    });
    box.style.height = `${layout.height}px`;
  };

  // On a narrow screen a legend beside the plot would take its room: it goes below, a line an entry.
  const narrow = (box, { data, layout }) => {
    const entries = data.filter((line) => line.name && line.showlegend !== false).length;
    if (box.clientWidth > 700 || layout.showlegend === false || layout.legend?.orientation === "h" || entries < 2) return;
    const room = 20 * entries;
    layout.legend = { orientation: "h", x: 0, yref: "container", y: 0, yanchor: "bottom", entrywidth: 1, entrywidthmode: "fraction" };
    layout.margin = { ...layout.margin, b: layout.margin.b + room };
    layout.height += room;
    box.style.height = `${layout.height}px`;
  };

  // In a single file the library is folded; the page's policy allows it by its hash.
  const folded = document.querySelector("[data-plotly]");
  const library = folded && crossbody.text(folded).then((text) => {
    const script = document.createElement("script");
    script.textContent = text;
    document.head.append(script);
  });
  // Plotly takes a table, such as that of a heat map, as an array of its rows.
  const tabulate = (trace) => Object.entries(trace).forEach(([key, { width, length } = {}]) => {
    if (width && length) trace[key] = Array.from({ length: length / width }, (_, i) => trace[key].subarray(i * width, (i + 1) * width));
  });
  const known = new Map(); // figures that are unfolded: these are drawn at once, which a print does not wait for
  const ready = new Map();
  const prepare = (box) => {
    const value = crossbody.value(document.querySelector(`script[data-plot="${CSS.escape(box.id)}"]`));
    ready.set(box, Promise.all([value, library]).then(([figure]) => { figure.data.forEach(tabulate); known.set(box, figure); }));
    watch.observe(box);
  };
  const make = (box) => {
    const figure = known.get(box);
    const over = named(box, figure);
    stacked(box, figure);
    narrow(box, figure);
    const mark = document.createElement("div");
    mark.className = "cursor";
    figure.data.push(...figure.data.flatMap(around));
    const shown = visible(figure.data);
    figure.data.forEach((trace, i) => { trace.visible = shown[i]; });
    charts.set(box, { mark, over });
    return Plotly.newPlot(box, figure.data, themed(figure.layout), options).then(() => {
      box.append(mark);
      if (over) {
        box.append(over);
        name(box);
        box.on("plotly_afterplot", () => name(box));
      }
      sight.observe(box);
      box.dataset.drawn = "";
      if (figure.layout.xaxis?.range) box.dataset.range = JSON.stringify(figure.layout.xaxis.range);
      box.on("plotly_hover", (event) => { if (box.hasAttribute("data-time")) crossbody.tell("time", event.points[0].x, box); });
      box.on("plotly_relayout", (update) => zoom(box, update));
    });
  };
  const draw = (box) => {
    if (!begun.has(box)) begun.set(box, known.has(box) ? make(box) : ready.get(box).then(() => make(box)));
    return begun.get(box);
  };
  const watch = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      watch.unobserve(entry.target);
      draw(entry.target);
    }
  }, { rootMargin: "500px" });
  crossbody.each(".plot", prepare);
  // Of figures of several contacts those of one are seen, the same in every section of a page that has it.
  const choose = (select) => {
    const section = select.closest("section");
    section.querySelectorAll("[data-of]").forEach((each) => { each.hidden = each.dataset.of !== select.value; });
    section.querySelectorAll("[data-of]:not([hidden]) .plot").forEach((box) => { if ("drawn" in box.dataset) Plotly.Plots.resize(box); });
  };
  crossbody.each("[data-choice]", (select) => {
    choose(select);
    select.addEventListener("change", () => select.closest("[data-page]").querySelectorAll("[data-choice]").forEach((each) => {
      if ([...each.options].some((option) => option.value === select.value)) each.value = select.value;
      choose(each);
    }));
  });
  const sized = (size) => charts.forEach((_, box) => Plotly.relayout(box, size));
  addEventListener("beforeprint", () => {
    document.querySelectorAll(".plot:not([hidden] *)").forEach(draw);
    sized({ width: PAPER, autosize: false });
  });
  addEventListener("afterprint", () => sized({ width: null, autosize: true }));
  crossbody.on("theme", () => charts.forEach((_, box) => Plotly.relayout(box, scheme(box.layout))));
  crossbody.on("engines", () => document.querySelectorAll(".curves [data-line]").forEach((each) => { each.hidden = !crossbody.shown(each.dataset.line); }));
  crossbody.on("engines", () => charts.forEach((_, box) => Plotly.restyle(box, { visible: visible(box.data) })));
  let clock = null;
  const marks = () => { if (clock !== null) near.forEach((box) => cursor(box, clock)); };
  crossbody.on("time", (t) => { clock = t; marks(); });
})();
