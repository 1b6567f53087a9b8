"use strict";
// Theme, pages in one file, filters, tables as CSV. What plots and playback share stands in `crossbody`.
const crossbody = (() => {
  const listeners = { time: [], engines: [], theme: [], page: [], unfolded: [] };
  const on = (what, call) => listeners[what].push(call);
  const tell = (what, ...given) => listeners[what].forEach((call) => call(...given));
  const hidden = new Set();
  // For every element there is, and for those of pages that are unfolded later.
  const each = (selector, call) => {
    const look = (root) => root.querySelectorAll(selector).forEach(call);
    look(document);
    on("unfolded", look);
  };
  // What html.py folded: a text, or a value whose arrays stand behind its JSON.
  const inflated = (element) => {
    const bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
  };
  const ARRAYS = { f4: [Float32Array, Uint32Array], f8: [Float64Array, BigUint64Array], i1: [Int8Array, Uint8Array], i2: [Int16Array, Uint16Array], i4: [Int32Array, Uint32Array] };
  const numbers = (bytes, [place, kind, count, width, rows]) => {
    const [Array_, Whole] = ARRAYS[kind];
    const [size, raw] = [Array_.BYTES_PER_ELEMENT, new Uint8Array(count * Array_.BYTES_PER_ELEMENT)];
    for (let k = 0; k < size; k += 1) for (let i = 0; i < count; i += 1) raw[i * size + k] = bytes[place + k * count + i];
    const whole = new Whole(raw.buffer);
    for (let i = width; i < count; i += 1) whole[i] += whole[i - width];
    return Object.assign(new Array_(raw.buffer), rows && { width });
  };
  const text = (element) => inflated(element).text();
  const value = async (element) => {
    const buffer = await inflated(element).arrayBuffer();
    const end = 4 + new DataView(buffer).getUint32(0, true);
    const bytes = new Uint8Array(buffer, end);
    const read = (_, given) => (given && given.packed ? numbers(bytes, given.packed) : given);
    return JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, end - 4)), read);
  };
  return { on, tell, each, text, value, hidden, shown: (name) => !hidden.has(name) };
})();

(() => {
  const theme = document.getElementById("theme");
  theme.value = document.documentElement.dataset.theme || "";
  theme.addEventListener("change", () => {
    if (theme.value) document.documentElement.dataset.theme = theme.value;
    else delete document.documentElement.dataset.theme;
    try { localStorage.setItem("crossbody-theme", theme.value); } catch { /* a browser may refuse storage to a file */ }
    crossbody.tell("theme");
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => crossbody.tell("theme"));
})();

(() => {
  // "#page--section~engine~metric": the page that holds the section is shown, and its verdicts are those of both.
  const pages = [...document.querySelectorAll("[data-page]")];
  const unfold = async (page) => {
    const folded = page.querySelector("[data-packed]");
    if (!folded) return;
    folded.removeAttribute("data-packed");
    page.innerHTML = await crossbody.text(folded);
    crossbody.tell("unfolded", page);
  };
  const go = async () => {
    const asked = location.hash;
    const [id, engine, metric] = decodeURIComponent(asked.slice(1)).split("~");
    const named = pages.filter((each) => id === each.id || id.startsWith(`${each.id}--`)).sort((a, b) => b.id.length - a.id.length)[0];
    const page = named || pages[0];
    await unfold(page);
    if (asked !== location.hash) return; // somebody went on meanwhile
    const target = document.getElementById(id);
    if (pages.length > 1) pages.forEach((each) => { each.hidden = each !== page; });
    if (engine && named) {
      const [select, show] = ["engine", "verdict"].map((name) => page.querySelector(`select[data-filter="${name}"]`));
      if (select && [...select.options].some((option) => option.value === engine)) {
        select.value = engine;
        page.querySelector('input[data-filter="words"]').value = metric || "";
        // Of the rows that can be shown as many as it takes to see what was asked for.
        const seen = () => [...show.closest("section").querySelectorAll("tbody tr:not([hidden])")]
          .some((row) => !metric || row.cells[2].textContent === metric);
        for (const kind of [show.value, "judged", "all"]) {
          show.value = kind;
          select.dispatchEvent(new Event("change"));
          if (seen()) break;
        }
      }
    }
    if (target && (engine || pages.length > 1)) target.scrollIntoView();
    else if (!target && pages.length > 1) scrollTo(0, 0);
    crossbody.tell("page");
  };
  addEventListener("hashchange", go);
  addEventListener("click", (event) => { // the same cell again, after the filter was changed
    const cell = event.target.closest?.(".cell a");
    if (cell && cell.hash && cell.href === location.href) go();
  });
  addEventListener("load", go);
})();

(() => {
  const verdicts = (section) => {
    const value = (name) => section.querySelector(`[data-filter="${name}"]`).value;
    const words = value("words").toLowerCase().split(/\s+/).filter(Boolean);
    const [show, engine] = [value("verdict"), value("engine")];
    section.querySelectorAll("tbody tr").forEach((row) => {
      const verdict = row.dataset.verdict;
      const wanted = show === "all" || "beyond" in row.dataset
        || (show === "judged" ? verdict !== "not judged" : verdict.endsWith("outside") || verdict === "crashed");
      const mine = engine ? row.dataset.engine === engine : crossbody.shown(row.dataset.engine);
      row.hidden = !(wanted && mine && words.every((word) => row.textContent.toLowerCase().includes(word)));
    });
    section.querySelector("[data-none]").hidden = Boolean(section.querySelector("tbody tr:not([hidden])"));
  };
  crossbody.each('[data-filter="verdict"]', (select) => {
    const section = select.closest("section");
    const filter = () => verdicts(section);
    section.querySelectorAll("[data-filter]").forEach((field) => {
      field.addEventListener("input", filter);
      field.addEventListener("change", filter);
    });
    crossbody.on("engines", filter);
    section.querySelector("[data-show-rows]").addEventListener("click", () => {
      section.querySelectorAll("[data-filter]").forEach((field) => { field.value = field.dataset.filter === "verdict" ? "all" : ""; });
      if (!section.querySelector("tbody tr[data-engine]:not([hidden])")) crossbody.hidden.clear();
      crossbody.tell("engines");
    });
    filter();
  });
  crossbody.each('[data-filter="lines"]', (field) => field.addEventListener("input", () => {
    const word = field.value.toLowerCase();
    field.closest("section").querySelectorAll("tbody tr").forEach((row) => {
      row.hidden = !row.querySelector("th").textContent.toLowerCase().includes(word);
    });
    field.closest("section").querySelector("[data-none]").hidden = Boolean(field.closest("section").querySelector("tbody tr:not([hidden])"));
  }));
})();

(() => {
  const press = (button) => button.setAttribute("aria-pressed", crossbody.shown(button.dataset.show));
  crossbody.on("engines", () => document.querySelectorAll("[data-show]").forEach(press));
  crossbody.each("[data-show]", (button) => {
    press(button);
    button.addEventListener("click", () => {
      const name = button.dataset.show;
      if (!crossbody.hidden.delete(name)) crossbody.hidden.add(name);
      crossbody.tell("engines");
    });
  });
  const columns = (table) => {
    const heads = [...table.querySelectorAll("[data-heads] th")];
    heads.forEach((head, i) => {
      head.hidden = !crossbody.shown(head.dataset.name.replace(/:$/, ""));
      table.querySelectorAll("tbody tr").forEach((row) => { row.cells[i + 1].hidden = head.hidden; });
    });
    table.querySelectorAll('th[scope="colgroup"]').forEach((group) => {
      group.dataset.span ||= group.colSpan;
      const left = heads.splice(0, group.dataset.span).filter((head) => !head.hidden && !head.classList.contains("folded")).length;
      group.hidden = !left;
      group.colSpan = left || 1;
    });
  };
  // Columns that do not fit are folded, the last ones first; of a matrix those with nothing beyond a limit before others.
  const BEYOND = ".outside, .expected-outside, .beyond-not-judged, .crashed";
  const cells = (table, i) => [...table.tBodies[0].rows].map((row) => row.cells[i]).filter(Boolean);
  const fit = (table) => {
    const [box, matrix] = [table.closest(".scroll"), table.matches(".matrix")];
    const heads = matrix ? [...table.querySelectorAll("[data-heads] th")] : [...table.tHead.rows[0].cells].slice(1);
    const own = new Map(heads.map((head, i) => [head, [head, ...cells(table, i + 1)]]));
    const fold = (some) => {
      own.forEach((each, head) => each.forEach((cell) => cell.classList.toggle("folded", some.includes(head))));
      if (matrix) columns(table);
    };
    fold([]);
    if (!box.clientWidth || "whole" in box.dataset) return;
    const dear = (head) => matrix && own.get(head).some((cell) => cell.matches(BEYOND));
    const last = [...heads].reverse().filter((head) => !head.hidden).sort((a, b) => dear(a) - dear(b));
    let [fewest, most] = [0, last.length - 1]; // by bisection: to lay out a large table takes a while
    while (fewest < most) {
      const middle = Math.floor((fewest + most) / 2);
      fold(last.slice(0, middle));
      if (table.scrollWidth > box.clientWidth + 1) fewest = middle + 1;
      else most = middle;
    }
    fold(last.slice(0, most));
  };
  const FITTED = ".scroll > table:is(.matrix, details.table table)";
  crossbody.each(FITTED, (table) => {
    const [box, button] = [table.closest(".scroll"), document.createElement("button")];
    const again = () => {
      const folded = (fit(table), table.querySelectorAll("thead .folded").length);
      button.hidden = !folded && !("whole" in box.dataset);
      button.textContent = folded ? `${folded} more column${folded > 1 ? "s" : ""}` : "Fewer columns";
    };
    button.type = "button";
    button.className = "save";
    button.addEventListener("click", () => {
      if ("whole" in box.dataset) delete box.dataset.whole;
      else box.dataset.whole = "";
      again();
    });
    box.after(button);
    crossbody.on("engines", again);
    let seen = -1; // the width for which it is fitted: what is folded changes heights
    new ResizeObserver(() => {
      const width = box.parentElement.clientWidth;
      if (width !== seen) again();
      seen = width;
    }).observe(box.parentElement);
    box.closest("details")?.addEventListener("toggle", again);
  });
  const rows = (row) => { row.hidden = !crossbody.shown(row.dataset.engine.replace(/:$/, "")); };
  const OWN = ":is(details.table tr, .causes li)[data-engine]";
  crossbody.each(OWN, rows);
  crossbody.on("engines", () => document.querySelectorAll(OWN).forEach(rows));
  crossbody.each("[data-show-all]", (button) => button.addEventListener("click", () => {
    crossbody.hidden.clear();
    crossbody.tell("engines");
  }));
})();

(() => {
  const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const cell = (td) => ("v" in td.dataset ? td.dataset.v : td.textContent.replace(/\s+/g, " ").trim());
  const csv = (table) => {
    const heads = table.tHead.rows.length > 1 ? [...table.tHead.querySelectorAll("[data-name]")].map((th) => th.dataset.name)
      : [...table.tHead.rows[0].cells].map((th) => th.textContent.trim());
    const rows = [...table.tBodies[0].rows].map((row) => [...row.cells].map(cell));
    return [heads, ...rows].map((row) => row.map(quoted).join(",")).join("\r\n") + "\r\n";
  };
  crossbody.each("table[data-csv]", (table) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "save";
    button.textContent = "Save as CSV";
    button.addEventListener("click", () => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([csv(table)], { type: "text/csv" }));
      link.download = `${table.dataset.csv}.csv`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
    table.closest(".scroll").after(button);
  });
})();

(() => {
  // On paper: light, everything open.
  const root = document.documentElement;
  let [kept, opened] = ["", []];
  addEventListener("beforeprint", () => {
    kept = root.dataset.theme;
    root.dataset.theme = "light";
    opened = [...document.querySelectorAll("details:is(.table, .fold, .lead):not([open])")];
    opened.forEach((each) => { each.open = true; });
    crossbody.tell("theme");
  });
  addEventListener("afterprint", () => {
    if (kept) root.dataset.theme = kept;
    else delete root.dataset.theme;
    opened.forEach((each) => { each.open = false; });
    crossbody.tell("theme");
  });
})();
