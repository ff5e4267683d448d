"use strict";
(function () {
  var dark = window.matchMedia("(prefers-color-scheme: dark)");
  var specs = new Map();

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function template() {
    var axis = {
      gridcolor: colour("--grid"), linecolor: colour("--line"), tickcolor: colour("--line"), zerolinecolor: colour("--line"),
      zerolinewidth: 1, automargin: true, ticks: "outside", ticklen: 4, showline: true, title: { standoff: 8 }
    };
    return {
      layout: {
        font: { family: getComputedStyle(document.body).fontFamily, size: 12.5, color: colour("--ink") },
        paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        xaxis: axis, yaxis: axis,
        legend: { font: { size: 12 }, itemsizing: "constant", bgcolor: "rgba(0,0,0,0)" },
        hoverlabel: { font: { size: 12.5 }, align: "left" },
        margin: { l: 12, r: 12, t: 12, b: 12 }
      }
    };
  }

  // The darkest colours of the scale cannot be told from a dark page; on a phone the scale lies below the plot, which gets its width.
  function colours(axis, narrow) {
    var changes = {};
    if (dark.matches) { changes.colorscale = [[0, "#2a788e"], [0.35, "#22a884"], [0.7, "#7ad151"], [1, "#fde725"]]; }
    if (narrow && axis.colorbar) {
      changes.colorbar = Object.assign({}, axis.colorbar, {
        orientation: "h", y: -0.2, yanchor: "top", title: Object.assign({}, axis.colorbar.title, { side: "bottom" })
      });
    }
    return Object.assign({}, axis, changes);
  }

  function withoutWebgl(spec) {
    spec.data.forEach(function (trace) { if (trace.type === "scattergl") { trace.type = "scatter"; } });
  }

  function hasWebgl() {
    var canvas = document.createElement("canvas");
    var context = canvas.getContext("webgl");
    if (context === null) { return false; }
    var extension = context.getExtension("WEBGL_lose_context");
    if (extension) { extension.loseContext(); }
    return true;
  }

  function draw(element) {
    var spec = specs.get(element);
    var layout = Object.assign({}, spec.layout, { template: template() });
    if (layout.coloraxis) { layout.coloraxis = colours(layout.coloraxis, element.clientWidth < 480); }
    var data = spec.data.map(function (trace) {
      return trace.type === "heatmap" && trace.colorscale ? colours(trace, element.clientWidth < 480) : trace;
    });
    return Plotly.react(element, data, layout, {
      responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage"]],
      toImageButtonOptions: { format: "png", filename: element.id, scale: 4 }
    });
  }

  function redraw() { specs.forEach(function (_, element) { draw(element); }); }

  var webgl = hasWebgl();
  var waiting = Array.from(document.querySelectorAll(".plot"));
  waiting.forEach(function (element) {
    var spec = JSON.parse(document.getElementById(element.id + "-data").textContent);
    element.style.minHeight = spec.layout.height + "px";
    if (!webgl) { withoutWebgl(spec); }
    specs.set(element, spec);
  });
  function next() {
    if (waiting.length) { draw(waiting.shift()).then(function () { setTimeout(next, 0); }); }
  }
  next();
  dark.addEventListener("change", redraw);
}());
