"use strict";
(() => {
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const scheme = (layout) => {
    const out = { paper_bgcolor: colour("--paper"), plot_bgcolor: colour("--paper"), "font.color": colour("--ink") };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) {
        out[key + ".gridcolor"] = colour("--line");
        out[key + ".linecolor"] = colour("--line");
        out[key + ".zerolinecolor"] = colour("--line");
      }
    }
    return out;
  };
  const options = { responsive: true, displaylogo: false };
  const drawn = [];
  const draw = (script) => {
    const box = document.getElementById(script.dataset.plot);
    const figure = JSON.parse(script.textContent);
    drawn.push(box);
    Plotly.newPlot(box, figure.data, figure.layout, options).then(() => Plotly.relayout(box, scheme(figure.layout)));
  };
  // A figure is drawn when it comes near the screen: a page of many cases opens at once.
  const watch = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      watch.unobserve(entry.target);
      draw(document.querySelector(`script[data-plot="${entry.target.id}"]`));
    }
  }, { rootMargin: "600px" });
  document.querySelectorAll(".plot").forEach((box) => watch.observe(box));
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("script[data-plot]").forEach((script) => {
      if (!drawn.includes(document.getElementById(script.dataset.plot))) draw(script);
    });
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () =>
    drawn.forEach((box) => Plotly.relayout(box, scheme(box.layout))));

  const show = document.getElementById("show");
  const find = document.getElementById("find");
  const filter = () => {
    const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    document.querySelectorAll("#verdict-table tbody tr").forEach((row) => {
      const verdict = row.dataset.verdict;
      const wanted = show.value === "all" || (show.value === "judged" ? verdict !== "not judged" : verdict.endsWith("outside"));
      const text = row.textContent.toLowerCase();
      row.hidden = !(wanted && words.every((word) => text.includes(word)));
    });
  };
  show.addEventListener("change", filter);
  find.addEventListener("input", filter);
  filter();
})();
