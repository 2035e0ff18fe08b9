// Draws the figures of the page, follows light, dark and paper, and connects the pickers.
(() => {
  "use strict";
  const root = document.documentElement;
  const figures = JSON.parse(document.getElementById("figure-data").textContent);
  const byId = new Map(figures.map((figure) => [figure.id, figure]));
  const narrow = window.matchMedia("(max-width: 40rem)");
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const config = {
    responsive: false,
    displaylogo: false,
    // Without a pointer that hovers, the buttons would hide the legends all the time.
    displayModeBar: window.matchMedia("(hover: hover)").matches ? "hover" : false,
    modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
    toImageButtonOptions: { format: "svg" },
  };

  const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

  // Fields of `over` win; both stay as they are.
  const merged = (under, over) => {
    const out = { ...under };
    for (const [key, value] of Object.entries(over)) {
      out[key] = isObject(value) && isObject(out[key]) ? merged(out[key], value) : value;
    }
    return out;
  };

  const colours = (paper) => {
    if (paper) return { ink: "#000", soft: "#444", grid: "#ddd" };
    const style = getComputedStyle(root);
    const get = (name) => style.getPropertyValue(name).trim();
    return { ink: get("--ink"), soft: get("--soft"), grid: get("--grid") };
  };

  const wide = (figure) =>
    document.getElementById(figure.id).closest(".one, .fill > figure:last-child:nth-child(odd)") !== null;

  // On paper nothing redraws a figure when its box changes: there the drawing shrinks with the box.
  const scale = (element, paper) => {
    for (const svg of element.querySelectorAll(".main-svg")) {
      if (paper) svg.setAttribute("viewBox", `0 0 ${svg.getAttribute("width")} ${svg.getAttribute("height")}`);
      else svg.removeAttribute("viewBox");
    }
  };

  const theme = (figure, paper) => {
    const { ink, soft, grid } = colours(paper);
    const axis = {
      gridcolor: grid, zerolinecolor: soft, linecolor: grid, tickcolor: grid, automargin: true, zeroline: false,
      title: { standoff: 8, font: { size: 13 } },
    };
    const base = {
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: ink, size: 12, family: getComputedStyle(document.body).fontFamily },
      margin: { l: 48, r: 10, t: 30, b: 42 },
      legend: { orientation: "h", x: 0, y: 1.01, yanchor: "bottom", font: { size: 12 }, itemsizing: "constant" },
      hoverlabel: { font: { family: getComputedStyle(document.body).fontFamily } },
      autosize: true,
      modebar: { bgcolor: "rgba(0,0,0,0)", color: soft, activecolor: ink },
      xaxis: axis,
      yaxis: axis,
      dragmode: narrow.matches ? false : "zoom",
    };
    if (figure.layout.scene) {
      const wall = { ...axis, showbackground: false, zeroline: false };
      delete wall.automargin;
      base.scene = { xaxis: wall, yaxis: wall, zaxis: wall };
      base.dragmode = "turntable";
      delete base.xaxis;
      delete base.yaxis;
    }
    const layout = merged(base, figure.layout);
    if (paper) {
      // Paper has its own width, which is not known yet: drawn at the size of a card there, and scaled by the view box.
      layout.width = wide(figure) ? 860 : 430;
      layout.height = Math.round(layout.width / (wide(figure) ? 2.8 : figure.aspect));
      layout.autosize = false;
    }
    if (layout.yaxis && layout.yaxis.zeroline) layout.yaxis.zerolinewidth = 1.5;
    return layout;
  };

  const data = (figure, paper) => {
    const traces = figure.data.map((trace) => {
      const copy = { ...trace };
      for (const bar of ["error_x", "error_y"]) {
        if (copy[bar]) copy[bar] = { color: colours(paper).ink, ...copy[bar] };
      }
      // On a narrow screen a colour bar beside the map would leave no room for the map.
      if (copy.colorbar && narrow.matches) {
        copy.colorbar = { ...copy.colorbar, orientation: "h", y: -0.3, yanchor: "top", thickness: 10,
          title: { ...copy.colorbar.title, side: "right" } };
      }
      return copy;
    });
    if (figure.variants) Object.assign(traces[0], merged(traces[0], figure.variants[figure.chosen || 0].trace));
    return traces;
  };

  const canDraw3d = (() => {
    try {
      const canvas = document.createElement("canvas");
      return Boolean(canvas.getContext("webgl") || canvas.getContext("experimental-webgl"));
    } catch {
      return false;
    }
  })();

  const draw = (figure, paper) => {
    const element = document.getElementById(figure.id);
    if (!element) return Promise.resolve();
    element.classList.toggle("map", figure.data.some((trace) => trace.colorbar));
    if (figure.layout.scene && !canDraw3d) {
      element.classList.add("failed");
      element.textContent = "This browser cannot draw in three dimensions; the figures beside show the same boards.";
      return Promise.resolve();
    }
    return Plotly.react(element, data(figure, paper), theme(figure, paper), config).then(() => scale(element, paper)).catch((error) => {
      element.classList.add("failed");
      element.textContent = "This figure could not be drawn.";
      console.error(`figure ${figure.id}: ${error}`);
    });
  };

  const drawAll = (paper) => typeof Plotly !== "undefined" && Promise.all(figures.map((figure) => draw(figure, paper)));

  for (const picker of document.querySelectorAll(".picker")) {
    const select = picker.querySelector("select");
    const output = picker.querySelector("output");
    const targets = picker.dataset.figures.split(" ").map((id) => byId.get(id));
    const choose = (index, drawn = true) => {
      select.selectedIndex = index;
      output.textContent = targets[0].variants[index].note;
      for (const figure of targets) {
        figure.chosen = index;
        if (drawn) draw(figure, false);
      }
    };
    select.addEventListener("change", () => choose(select.selectedIndex));
    for (const button of picker.querySelectorAll("button")) {
      button.addEventListener("click", () => {
        const count = select.options.length;
        choose((select.selectedIndex + Number(button.dataset.step) + count) % count);
      });
    }
    choose(Number(picker.dataset.start), false);
  }

  // Figures follow their cards, whatever changes the width of these.
  const waiting = new Set();
  const observer = new ResizeObserver((entries) => {
    for (const { target } of entries) waiting.add(target);
    requestAnimationFrame(() => {
      for (const element of waiting) {
        if (element.classList.contains("js-plotly-plot") && element.clientWidth > 0) Plotly.Plots.resize(element);
      }
      waiting.clear();
    });
  });
  for (const element of document.querySelectorAll(".plot")) observer.observe(element);

  dark.addEventListener("change", () => drawAll(false));
  narrow.addEventListener("change", () => drawAll(false));
  window.addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((d) => { d.open = true; });
    drawAll(true);
  });
  window.addEventListener("afterprint", () => drawAll(false));

  for (const picture of document.querySelectorAll(".picture")) {
    const toggle = () => picture.classList.toggle("large");
    picture.addEventListener("click", toggle);
    picture.addEventListener("keydown", (event) => { if (event.key === "Enter") toggle(); });
  }

  // The library is packed, which halves the file.
  const unpack = async () => {
    const packed = Uint8Array.from(atob(document.getElementById("library").textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  };

  // What is seen first is drawn first; the page stays responsive in between.
  (async () => {
    try {
      await unpack();
    } catch {
      document.getElementById("no-figures").hidden = false;
      return;
    }
    for (const figure of figures) {
      await draw(figure, false);
      await new Promise((resolve) => setTimeout(resolve, 0));
    }
    root.dataset.figures = String(document.querySelectorAll(".plot .main-svg").length > 0 || figures.length === 0);
    root.dataset.ready = "true";
  })();
})();
