// The replay of a world that is drawn from shapes, as envs/shapes.py describes them.
const PANEL_PT = 259.2; // the width of a panel there, in points

function drawShapes(canvas, { limits, looks, still, trail, trail_shots, shots, success }, now) {
    const [[left, right], [low, high]] = limits, at = canvas.getContext("2d");
    canvas.height = Math.round((canvas.width * (high - low)) / (right - left)); // this clears it, too
    const scale = canvas.width / (right - left);
    const from = trail_shots === null ? 0 : Math.max(0, now + 1 - trail_shots);
    const way = trail ? [[trail[0], trail[1].slice(from, now + 1)]] : [];
    for (const [look, places] of [...still, ...way, ...shots[now]]) {
        drawShape(at, looks[look], places.map(([x, y]) => [(x - left) * scale, (high - y) * scale]), scale);
    }
    if (now < shots.length - 1) return;
    at.lineWidth = 12;
    at.strokeStyle = colour(success ? "good" : "bad");
    at.strokeRect(0, 0, canvas.width, canvas.height);
}

// Draw a shape at places in pixels; `scale` is in pixels per unit of the picture.
function drawShape(at, { ink, fill, width_pt = 1, radius, dashed, text, hangs }, places, scale) {
    const width = (width_pt * at.canvas.width) / PANEL_PT, [[x, y]] = places;
    at.beginPath();
    if (text) {
        at.font = `${width}px system-ui, sans-serif`;
        at.textAlign = "center";
        at.textBaseline = hangs ? "top" : "bottom";
        at.fillStyle = colour(ink);
        at.fillText(text, x, y);
        return;
    }
    if (radius) at.arc(x, y, radius * scale, 0, 2 * Math.PI);
    else for (const place of places) at.lineTo(...place);
    if (fill) {
        at.closePath();
        at.fillStyle = colour(fill);
        at.fill();
    }
    if (!ink) return;
    at.lineWidth = width;
    at.lineCap = "round";
    at.setLineDash(dashed ? [3 * width, 2.5 * width] : []);
    at.strokeStyle = colour(ink);
    at.stroke();
}
