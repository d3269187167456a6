// The replay of the best run's test. The steps are those that the environment recorded.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const SLOWEST = 15, LONGEST_S = 20; // a replay's least moments per second, and its longest time
const replay = data.replay;
const moment = { phase: "after", situation: 0, at: 0, playing: false };

function film() {
    return replay.films?.[moment.phase][moment.situation];
}

function told() {
    return moment.phase === "after" ? replay.told?.[moment.situation] : undefined;
}

// Return the number of the last moment; of a long situation not every step is shown.
function moments() {
    return film() ? film().shots.length - 1 : told().seen.length;
}

// Show the present moment: the picture, the words and the rules that fire.
function showMoment() {
    moment.at = Math.min(moment.at, moments());
    byId("at").max = moments();
    byId("at").value = moment.at;
    byId("go").textContent = moment.playing ? "Pause" : "Play";
    byId("now").textContent = words();
    if (film()) (film().looks ? drawShapes : drawFilm)(byId("world"), film(), moment.at);
    const fired = new Map(told()?.fired[moment.at] ?? []);
    for (const cell of document.querySelectorAll("[data-rule]")) {
        // The root makes rules that fire weakly visible, too.
        cell.style.setProperty("--fired", Math.sqrt(fired.get(Number(cell.dataset.rule)) ?? 0));
    }
    const [most] = [...fired].sort(([, one], [, other]) => other - one);
    if (most) bringIntoView(document.querySelector(`[data-rule="${most[0]}"]`));
}

// Scroll the table of a long rule base, but not the page, until it shows a rule.
function bringIntoView(cell) {
    const box = cell.closest(".scroll"), inside = box.getBoundingClientRect(), here = cell.getBoundingClientRect();
    if (here.top < inside.top || here.bottom > inside.bottom) {
        box.scrollTop += (here.top + here.bottom - inside.top - inside.bottom) / 2;
    }
}

function words() {
    const seen = told()?.seen[moment.at];
    const numbers = seen ? seen.map((value, n) => `${replay.names[n]} ${value.toFixed(2)}`).join(", ") : "";
    const { steps, every } = film() ?? told();
    const over = moment.at === moments() ? `, the end: ${ending(moment.situation)}` : "";
    const step = `Step ${Math.min(moment.at * every, steps)} of ${steps}`;
    return `${step}${over}${numbers && `: ${numbers}`}`;
}

function ending(situation) {
    const it = replay.films?.[moment.phase][situation] ?? replay.told[situation];
    return it.success ? "a success" : "no success";
}

// List the situations; their endings depend on whether the run has learned.
function listSituations() {
    const count = (replay.films?.after ?? replay.told).length;
    byId("situation").replaceChildren(
        ...Array.from({ length: count }, (_, n) => new Option(`${n + 1}: ${ending(n)}`, n, false, n === moment.situation)));
}

function drawFilm(canvas, { still, shots, kinds, success }, now) {
    const [across, up] = still.half_size_m;
    const shot = shots[now], at = canvas.getContext("2d");
    // The picture shows the whole way of a robot that leaves the world's circle.
    const wider = Math.max(1, ...shots.map(({ pose: [x, y] }) => Math.max((Math.abs(x) + 0.3) / across, (Math.abs(y) + 0.3) / up)));
    canvas.height = Math.round((canvas.width * up) / across);
    const scale = canvas.width / (2.03 * across * wider);
    at.setTransform(1, 0, 0, 1, 0, 0);
    at.clearRect(0, 0, canvas.width, canvas.height);
    at.setTransform(scale, 0, 0, -scale, canvas.width / 2, canvas.height / 2);
    surroundings(at, shot.pose, {
        view: still.view_rad,
        beams: shot.beams ?? [],
        walls: still.walls ? still.half_size_m : null,
        discs: still.discs,
        boxes: still.boxes,
        scale,
    });
    const done = now === shots.length - 1, result = colour(success ? "good" : "bad");
    ways(at, shots, now, scale);
    shot.balls.forEach(([east, north, radius], n) => {
        at.fillStyle = colour(kinds[n] === "ball" ? "ball" : "c3");
        disc(at, east, north, radius);
    });
    const edge = done ? result : colour("robot");
    robotAt(at, shot.pose, { radius: still.radius_m, track: still.track_width_m, scale, edge, width: done ? 7 : 3.5 });
}

// Draw the ways of the robot and the balls: dashed before and after, the robot's own way so far solid.
function ways(at, shots, now, scale) {
    at.lineWidth = 2 / scale;
    at.setLineDash([5 / scale, 7 / scale]);
    shots[0].balls.forEach((_, n) => {
        at.strokeStyle = colour("ball");
        path(at, shots.map(({ balls }) => balls[n]));
    });
    at.strokeStyle = colour("robot");
    path(at, shots.map(({ pose }) => pose));
    at.setLineDash([]);
    at.lineWidth = 3 / scale;
    path(at, shots.slice(0, now + 1).map(({ pose }) => pose));
}

let last = 0;
function tick(now) {
    if (!moment.playing) return;
    if (now - last >= 1000 / Math.max(SLOWEST, moments() / LONGEST_S)) {
        last = now;
        if (moment.at === moments()) moment.playing = false;
        else moment.at += 1;
        showMoment();
    }
    requestAnimationFrame(tick);
}

function startReplay() {
    byId("go").addEventListener("click", () => {
        moment.playing = !moment.playing;
        if (moment.playing && moment.at === moments()) moment.at = 0;
        showMoment();
        requestAnimationFrame(tick);
    });
    byId("at").addEventListener("input", () => {
        moment.playing = false;
        moment.at = byId("at").valueAsNumber;
        showMoment();
    });
    byId("situation").addEventListener("change", () => {
        Object.assign(moment, { situation: Number(byId("situation").value), at: 0 });
        showMoment();
    });
    byId("phase")?.addEventListener("change", () => {
        Object.assign(moment, { phase: byId("phase").value, at: 0 });
        listSituations();
        showMoment();
    });
    listSituations();
    // The middle of a situation shows more than its start.
    moment.at = Math.floor(moments() / 2);
    showMoment();
}
