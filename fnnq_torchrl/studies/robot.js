// A robot and what is around it, seen from above: for every page that draws them.
const style = getComputedStyle(document.documentElement);
const colour = (name) => style.getPropertyValue(`--${name}`).trim();

function disc(at, x, y, radius) {
    at.beginPath();
    at.arc(x, y, radius, 0, 2 * Math.PI);
    at.fill();
}

function path(at, points) {
    at.beginPath();
    for (const [x, y] of points) at.lineTo(x, y);
    at.stroke();
}

// Draw a sector: a head's field of view or a sonar's beam.
function sector(at, x, y, radius, from, to) {
    at.beginPath();
    at.moveTo(x, y);
    at.arc(x, y, radius, from, to);
    at.fill();
}

// Draw what is around a robot: its field of view, its sonars' beams (x, y, direction, width, reading),
// the obstacles and the walls. A box is a list of its corners.
function surroundings(at, [x, y, heading], { view, beams, walls, discs, boxes, scale }) {
    if (view !== null) {
        at.fillStyle = colour("view");
        sector(at, x, y, 20, heading - view, heading + view);
    }
    at.fillStyle = colour("echo");
    for (const [east, north, direction, width, reading] of beams) {
        sector(at, east, north, reading, direction - width / 2, direction + width / 2);
    }
    at.fillStyle = colour("wall");
    for (const [east, north, radius] of discs) disc(at, east, north, radius);
    for (const corners of boxes) {
        at.beginPath();
        for (const [east, north] of corners) at.lineTo(east, north);
        at.fill();
    }
    at.lineWidth = 4 / scale;
    at.strokeStyle = colour("wall");
    if (walls) at.strokeRect(-walls[0], -walls[1], 2 * walls[0], 2 * walls[1]);
}

// Draw the robot's body, nose and wheels; `scale` is in pixels per metre.
function robotAt(at, [x, y, heading], { radius, track, scale, edge, width }) {
    at.lineWidth = width / scale;
    at.strokeStyle = edge;
    at.fillStyle = colour("page");
    disc(at, x, y, radius);
    at.stroke();
    path(at, [[x, y], [x + radius * Math.cos(heading), y + radius * Math.sin(heading)]]);
    at.fillStyle = colour("quiet");
    for (const side of [-1, 1]) {
        const out = side * Math.min(track / 2, 0.8 * radius);
        at.save();
        at.translate(x, y);
        at.rotate(heading);
        at.fillRect(-0.45 * radius, out - 0.12 * radius, 0.9 * radius, 0.24 * radius);
        at.restore();
    }
}
