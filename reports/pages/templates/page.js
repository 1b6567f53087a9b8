"use strict";
// Theme, pages in one file, filters, tables as CSV. What plots and playback share stands in `crossbody`.
const crossbody = (() => {
  const listeners = { time: [], engines: [], theme: [], page: [] };
  const on = (what, call) => listeners[what].push(call);
  const tell = (what, ...given) => listeners[what].forEach((call) => call(...given));
  const hidden = new Set();
  return { on, tell, hidden, shown: (name) => !hidden.has(name) };
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
  const go = () => {
    const [id, engine, metric] = decodeURIComponent(location.hash.slice(1)).split("~");
    const target = document.getElementById(id);
    const page = target ? target.closest("[data-page]") : null;
    if (pages.length > 1) pages.forEach((each) => { each.hidden = each !== (page || pages[0]); });
    if (engine && page) {
      const select = page.querySelector('select[data-filter="engine"]');
      if (select && [...select.options].some((option) => option.value === engine)) {
        select.value = engine;
        page.querySelector('input[data-filter="words"]').value = metric || "";
        select.dispatchEvent(new Event("change"));
      }
    }
    if (target && (engine || pages.length > 1)) target.scrollIntoView();
    else if (!target && pages.length > 1) scrollTo(0, 0);
    crossbody.tell("page");
  };
  addEventListener("hashchange", go);
  addEventListener("load", go);
})();

(() => {
  const verdicts = (section) => {
    const value = (name) => section.querySelector(`[data-filter="${name}"]`).value;
    const words = value("words").toLowerCase().split(/\s+/).filter(Boolean);
    const [show, engine] = [value("verdict"), value("engine")];
    section.querySelectorAll("tbody tr").forEach((row) => {
      const verdict = row.dataset.verdict;
      const wanted = show === "all" || (show === "judged" ? verdict !== "not judged" : verdict.endsWith("outside") || verdict === "crashed");
      const mine = engine ? row.dataset.engine === engine : crossbody.shown(row.dataset.engine);
      row.hidden = !(wanted && mine && words.every((word) => row.textContent.toLowerCase().includes(word)));
    });
  };
  document.querySelectorAll('[data-filter="verdict"]').forEach((select) => {
    const section = select.closest("section");
    const filter = () => verdicts(section);
    section.querySelectorAll("[data-filter]").forEach((field) => {
      field.addEventListener("input", filter);
      field.addEventListener("change", filter);
    });
    crossbody.on("engines", filter);
    filter();
  });
  document.querySelectorAll('[data-filter="lines"]').forEach((field) => field.addEventListener("input", () => {
    const word = field.value.toLowerCase();
    field.closest("section").querySelectorAll("tbody tr").forEach((row) => {
      row.hidden = !row.querySelector("th").textContent.toLowerCase().includes(word);
    });
  }));
})();

(() => {
  const buttons = [...document.querySelectorAll("[data-show]")];
  const tell = () => {
    buttons.forEach((button) => button.setAttribute("aria-pressed", crossbody.shown(button.dataset.show)));
    crossbody.tell("engines");
  };
  buttons.forEach((button) => button.addEventListener("click", () => {
    const name = button.dataset.show;
    if (!crossbody.hidden.delete(name)) crossbody.hidden.add(name);
    tell();
  }));
  document.querySelectorAll("[data-show-all]").forEach((button) => button.addEventListener("click", () => {
    crossbody.hidden.clear();
    tell();
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
  document.querySelectorAll("table[data-csv]").forEach((table) => {
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
  // On paper: light, every table open.
  const root = document.documentElement;
  let [kept, opened] = ["", []];
  addEventListener("beforeprint", () => {
    kept = root.dataset.theme;
    root.dataset.theme = "light";
    opened = [...document.querySelectorAll("details.table:not([open])")];
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
