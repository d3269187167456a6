// Draw the charts, in the colours of the reader's scheme, and start the replay.
const LINES = [0, 1, 2, 3, 4, 5, 6];

function config() {
    const text = colour("text"), quiet = colour("quiet"), line = colour("line");
    const words = { labelColor: text, titleColor: text, labelFontSize: 12, titleFontSize: 12, titleFontWeight: "normal" };
    return {
        background: "transparent",
        font: "system-ui, sans-serif",
        view: { stroke: "transparent" },
        axis: { ...words, gridColor: line, gridOpacity: 0.6, domainColor: quiet, tickColor: quiet, labelFlush: false },
        axisX: { tickCount: 8, labelOverlap: true },
        legend: words,
        range: { category: LINES.map((n) => colour(`c${n}`)) },
        mark: { color: colour("c0") },
        rule: { color: colour("c0") },
    };
}

async function drawCharts() {
    const places = [...document.querySelectorAll("[data-chart]")];
    const theme = dark.matches ? "dark" : undefined;
    await Promise.all(places.map((place) => {
        const spec = { ...data.charts[place.dataset.chart], width: "container", autosize: { type: "fit-x", contains: "padding" } };
        // With `ast`, expressions are interpreted: the page's policy allows no evaluation of texts.
        return vegaEmbed(place, spec, { config: config(), renderer: "svg", actions: false, ast: true, tooltip: { theme } });
    }));
    globalThis.report.drawn += 1;
}

globalThis.report = { drawn: 0, moment }; // for the tests, and for the browser's console
const dark = matchMedia("(prefers-color-scheme: dark)");
dark.addEventListener("change", () => {
    drawCharts();
    if (replay) showMoment();
});
drawCharts();
if (replay) startReplay();
