const data = JSON.parse(document.getElementById("data").textContent);
const { scene } = data;
const byId = (id) => document.getElementById(id);
const whole = (kind) => kind === "BigInt64Array";

// A robot with its own weights. Its leaves are the arrays that the step reads and writes.
class Robot {
    constructor(name) {
        this.name = name;
        this.leaf = data.leaves.map(([, kind, of]) => globalThis[kind].from(whole(kind) ? of.map(BigInt) : of));
        this.of = Object.fromEntries(data.leaves.map(([key], n) => [key, this.leaf[n]]));
        this.learn(data.weights[name]);
        this.canvas = byId(name);
        this.told = byId(`told-${name}`);
        this.ends = [0, 0];
        this.reach = half;
        this.begin();
    }

    learn(weights) {
        for (const [key, numbers] of Object.entries(weights)) this.of[`weights/${key}`].set(numbers);
    }

    begin() {
        for (const [key, numbers] of Object.entries(start)) this.of[`world/${key}`].set(numbers);
        this.of["world/seed"][0] = BigInt(Math.floor(Math.random() * 2 ** 31));
        this.trail = [];
        // A step at rest: the sensors see the objects, and the robot stays where it is.
        const speed = this.of["world/speed_mps"][0];
        this.of["world/speed_mps"][0] = 0;
        this.hold();
        step(this.leaf);
        this.of["world/speed_mps"][0] = speed;
        this.of["world/step"][0] = 0n;
        this.wait = 0;
        this.before = this.after = this.pose();
        this.seen = this.read();
    }

    // Copy the objects, which both robots share, into the robot's world.
    hold() {
        for (const [key, numbers] of Object.entries(shared)) this.of[`world/${key}`].set(numbers);
    }

    read() {
        return data.inputs.map((key) => this.of[`world/${key}`][0]);
    }

    pose() {
        return ["x_m", "y_m", "heading_rad"].map((key) => this.of[`world/${key}`][0]);
    }

    // One step of the world; after the end of a situation the robot waits, then starts again.
    step() {
        this.moved = false;
        if (this.wait > 0) {
            this.wait -= 1;
            if (this.wait === 0) this.begin();
            return;
        }
        this.hold();
        this.before = this.pose();
        this.seen = this.read();
        step(this.leaf);
        this.after = this.pose();
        this.moved = true;
        this.trail.push(this.after);
        if (this.of.done[0]) {
            this.ends[this.of.success[0] ? 1 : 0] += 1;
            this.wait = 12;
        }
        this.told.textContent = `${this.ends[1]} ${data.ends[1]}, ${this.ends[0]} ${data.ends[0]}`;
    }
}

// The state of the objects, each entry with its numbers. The situation's start is the robots' start.
const shared = {};
let start, situation = 0;

function nextSituation() {
    start = scene.starts[situation % scene.starts.length];
    situation += 1;
    for (const key of scene.shared) shared[key] = [...start[key]];
}

nextSituation();
const [across, up] = scene.half_size_m, half = Math.max(across, up) * (scene.walls ? 1.02 : 1);
const robots = [new Robot("before"), new Robot("after")];
const learned = robots[1];

// Return the balls and the obstacles. A thing that can be moved has a number in the shared entries.
function things() {
    const balls = scene.balls.map(([radius, kind], n) => ({ shape: "ball", n, radius, reach: radius, kind }));
    const loose = (shape, n, all) => n - (all.length - scene.loose[shape]);
    const discs = scene.discs.map(([x, y, fixed], i, all) => {
        const n = loose("disc", i, all), radius = n < 0 ? fixed : shared.disc_radius_m[n];
        return { shape: "disc", n, x, y, radius, reach: radius };
    });
    const boxes = scene.boxes.map(([x, y, width, height, fixed], i, all) => {
        const n = loose("box", i, all), heading = n < 0 ? fixed : shared.box_heading_rad[n];
        return { shape: "box", n, x, y, width, height, heading, reach: Math.hypot(width, height) };
    });
    for (const thing of [...balls, ...discs, ...boxes]) {
        if (thing.n >= 0) thing.x = shared[`${thing.shape}_x_m`][thing.n], thing.y = shared[`${thing.shape}_y_m`][thing.n];
    }
    return { balls, obstacles: [...discs, ...boxes] };
}

function movable() {
    const { balls, obstacles } = things();
    return [...balls, ...obstacles].filter(({ n, x }) => n >= 0 && Math.abs(x) < 1e3); // farther: left out
}

// -- pictures --------------------------------------------------------------------------------------
function draw(robot, share) {
    const canvas = robot.canvas, at = canvas.getContext("2d"), size = canvas.width;
    const reach = scene.walls ? half : Math.max(half, ...robot.after.slice(0, 2).map((x) => Math.abs(x) + 0.4));
    robot.reach += 0.1 * (reach - robot.reach); // the picture widens for a robot that drives away
    const scale = size / (2 * robot.reach), { balls, obstacles } = things();
    at.setTransform(1, 0, 0, 1, 0, 0);
    at.clearRect(0, 0, size, size);
    at.setTransform(0, -scale, -scale, 0, size / 2, size / 2); // ahead, the x axis, is up
    const pose = robot.before.map((from, n) => from + share * (robot.after[n] - from)), [x, y, heading] = pose;
    surroundings(at, pose, {
        view: scene.view_rad,
        beams: scene.ring.map(([ahead, left, turn], n) => [
            x + ahead * Math.cos(heading) - left * Math.sin(heading),
            y + ahead * Math.sin(heading) + left * Math.cos(heading),
            heading + turn,
            scene.beam_rad,
            robot.of["world/sonar_m"][n],
        ]),
        walls: scene.walls ? [across, up] : null,
        discs: obstacles.filter(({ shape }) => shape === "disc").map(({ x, y, radius }) => [x, y, radius]),
        boxes: obstacles.filter(({ shape }) => shape === "box").map(corners),
        scale,
    });
    at.lineWidth = 2 / scale;
    at.strokeStyle = colour("line");
    at.setLineDash([6 / scale, 6 / scale]);
    at.beginPath();
    if (scene.circle_m) at.arc(0, 0, scene.circle_m, 0, 2 * Math.PI);
    at.stroke();
    at.setLineDash([]);
    at.strokeStyle = colour("robot");
    path(at, [[start.x_m[0], start.y_m[0]], ...robot.trail.slice(0, -1), [x, y]]);
    const done = robot.wait > 0;
    robotAt(at, pose, {
        radius: scene.radius_m,
        track: scene.track_width_m,
        scale,
        edge: done ? colour(robot.of.success[0] ? "good" : "bad") : colour("robot"),
        width: done ? 6 : 3,
    });
    for (const { x, y, radius, kind } of balls) {
        at.fillStyle = colour(kind === "ball" ? "ball" : "other");
        disc(at, x, y, radius);
    }
    if (document.activeElement === canvas && movable().length > 1) ring(at, movable()[chosen], scale);
}

function corners({ x, y, width, height, heading }) {
    const cos = Math.cos(heading), sin = Math.sin(heading);
    return [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([i, j]) =>
        [x + i * width * cos - j * height * sin, y + i * width * sin + j * height * cos]);
}

// Draw a ring around the thing that the keys move.
function ring(at, { x, y, reach }, scale) {
    at.lineWidth = 2 / scale;
    at.strokeStyle = colour("text");
    at.beginPath();
    at.arc(x, y, reach + 5 / scale, 0, 2 * Math.PI);
    at.stroke();
}

// Draw Q of every candidate, on a scale from the lowest to the highest Q.
function drawValues() {
    const canvas = byId("values"), at = canvas.getContext("2d"), values = [...learned.of.action_value];
    const fine = globalThis.devicePixelRatio, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = fine * width;
    canvas.height = fine * height;
    at.scale(fine, fine);
    const low = Math.min(...values), high = Math.max(...values), span = Math.max(high - low, 1e-3);
    const left = 52, top = 14, bottom = height - 30, actions = data.candidates;
    const up = (value) => bottom - ((value - low) / span) * (bottom - top);
    const over = (action) => left + 14 + ((action - actions[0]) / (actions.at(-1) - actions[0])) * (width - left - 28);
    at.font = "13px system-ui, sans-serif";
    at.fillStyle = colour("quiet");
    at.strokeStyle = colour("line");
    at.textAlign = "right";
    for (const mark of [low, high]) {
        at.fillText(mark.toFixed(2), left - 6, up(mark) + 4);
        path(at, [[left, up(mark)], [width, up(mark)]]);
    }
    at.textAlign = "center";
    for (const mark of [0, 0.25, 0.5, 0.75, 1]) {
        const action = actions[0] + mark * (actions.at(-1) - actions[0]);
        at.fillText(action.toFixed(1), over(action), height - 8);
    }
    at.strokeStyle = colour("robot");
    path(at, values.map((value, n) => [over(actions[n]), up(value)]));
    values.forEach((value, n) => {
        const chosen = actions[n] === learned.of.action[0];
        at.fillStyle = colour(chosen ? "ball" : "robot");
        disc(at, over(actions[n]), up(value), chosen ? 7 : 3);
    });
    byId("why").textContent = why();
}

function why() {
    const steer = learned.of.action[0];
    const side = Math.abs(steer) < 0.005 ? "straight ahead" : steer > 0 ? "to the right" : "to the left";
    const seen = `The robot reads ${data.inputs.map((key, n) => `${key} ${fixed(learned.seen[n], 2)}`).join(", ")}.`;
    const does = `The highest value has ${data.action} ${fixed(steer, 1)} (${side}).`;
    if (!data.rules) return `${seen} ${does}`;
    const fired = [...learned.of.fired], most = fired.indexOf(Math.max(...fired));
    const value = number(learned.of["weights/weight"][most]);
    return `${seen} ${does} The rule that fires most: ${data.rules.sentences[most]} ${value}.`;
}

const number = (x) => Number(x.toFixed(4)).toString();
const fixed = (x, digits) => (Number(x.toFixed(digits)) + 0).toFixed(digits); // no minus before a zero

// -- the rules -------------------------------------------------------------------------------------
const cells = [];
if (data.rules) {
    const { rows, columns } = data.rules, grid = byId("grid");
    const head = grid.createTHead().insertRow();
    head.append(Object.assign(document.createElement("td"), { textContent: data.rules.corner }));
    for (const word of columns) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: word }));
    const body = grid.createTBody();
    rows.forEach((word, i) => {
        const row = body.insertRow();
        row.append(Object.assign(document.createElement("th"), { scope: "row", textContent: word }));
        columns.forEach((_, j) => {
            const n = i * columns.length + j, cell = row.insertCell();
            const input = Object.assign(document.createElement("input"), { type: "number", step: "0.05" });
            input.setAttribute("aria-label", data.rules.sentences[n]);
            input.addEventListener("input", () => {
                if (Number.isFinite(input.valueAsNumber)) learned.of["weights/weight"][n] = input.valueAsNumber;
            });
            cell.append(input);
            cells.push({ cell, input });
        });
    });
    showNumbers();
    byId("reset").addEventListener("click", () => {
        learned.learn(data.weights.after);
        showNumbers();
    });
    for (const file of data.files) {
        const button = Object.assign(document.createElement("button"), { type: "button", textContent: file.name });
        button.title = file.title;
        button.addEventListener("click", () => download(file));
        byId("files").append(button, " ");
    }
} else byId("rules").remove();

function showNumbers() {
    cells.forEach(({ input }, n) => (input.value = number(learned.of["weights/weight"][n])));
}

function light() {
    cells.forEach(({ cell }, n) => (cell.style.background = `rgba(${colour("lit")}, ${0.75 * learned.of.fired[n]})`));
}

// Return the file as the rules command writes it, with the numbers of the table.
function filled(file) {
    const numbers = [...learned.of["weights/weight"]];
    return file.text
        .replace(/@low@/g, String(Math.min(...numbers)))
        .replace(/@high@/g, String(Math.max(...numbers)))
        .replace(/@(\d+)@/g, (_, n) => String(numbers[n]));
}

function download(file) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([filled(file)], { type: "text/plain" }));
    link.download = file.name;
    link.click();
    URL.revokeObjectURL(link.href);
}

// -- the objects in the reader's hand --------------------------------------------------------------
let chosen = 0; // the number of the movable thing that the keys move

// Return the number of the thing to move from a place: the nearest within reach, else the first ball.
function grasp(x, y) {
    const near = movable().map((thing) => Math.hypot(thing.x - x, thing.y - y) - thing.reach);
    const nearest = near.indexOf(Math.min(...near));
    return near[nearest] < 0.15 ? nearest : scene.balls.length ? 0 : -1;
}

function take(x, y) {
    const { shape, n, reach } = movable()[chosen];
    const clamp = (place, edge) => Math.max(reach - edge, Math.min(edge - reach, place));
    const edges = scene.walls ? [across, up] : [half + reach, half + reach];
    shared[`${shape}_x_m`][n] = clamp(x, edges[0]);
    shared[`${shape}_y_m`][n] = clamp(y, edges[1]);
    if (shape === "ball") shared.held[n] = 1;
}

for (const robot of robots) {
    const canvas = robot.canvas;
    const place = (event) => {
        const box = canvas.getBoundingClientRect(), scale = box.width / (2 * robot.reach);
        return [robot.reach - (event.clientY - box.top) / scale, robot.reach - (event.clientX - box.left) / scale];
    };
    let holds = false;
    canvas.addEventListener("pointerdown", (event) => {
        const thing = grasp(...place(event));
        holds = thing >= 0;
        if (!holds) return;
        chosen = thing;
        canvas.setPointerCapture(event.pointerId);
        take(...place(event));
    });
    canvas.addEventListener("pointermove", (event) => holds && event.buttons && take(...place(event)));
    canvas.addEventListener("keydown", (event) => {
        const all = movable();
        const by = { ArrowUp: [0.1, 0], ArrowDown: [-0.1, 0], ArrowLeft: [0, 0.1], ArrowRight: [0, -0.1] }[event.key];
        if (all.length === 0 || !(by || event.key === "Enter")) return;
        event.preventDefault();
        if (by) take(all[chosen].x + by[0], all[chosen].y + by[1]);
        else chosen = (chosen + 1) % all.length;
    });
}

// -- the controls ----------------------------------------------------------------------------------
const dials = {
    speed_mps: { unit: "m/s" },
    noise: scene.noise === "noise"
        ? { unit: "times as large", max: 10, step: 0.1 }
        : { unit: "rad", max: 0.5, step: 0.005 },
    pace: { unit: "times as fast" },
};
for (const [id, { unit, ...limits }] of Object.entries(dials)) {
    const dial = Object.assign(byId(id), limits), told = document.querySelector(`output[for=${id}]`);
    const tell = () => (told.textContent = `${dial.value} ${unit}`);
    if (id !== "pace") {
        const key = `world/${id === "noise" ? scene.noise : id}`;
        dial.value = learned.of[key][0];
        dial.addEventListener("input", () => robots.forEach((robot) => (robot.of[key][0] = dial.valueAsNumber)));
    }
    dial.addEventListener("input", tell);
    tell();
}
let running = true;
byId("pause").addEventListener("click", () => {
    running = !running;
    byId("pause").textContent = running ? "Pause" : "Go on";
});
byId("restart").addEventListener("click", () => robots.forEach((robot) => robot.begin()));
byId("next").addEventListener("click", () => {
    nextSituation();
    chosen = 0;
    robots.forEach((robot) => robot.begin());
});

// -- time ------------------------------------------------------------------------------------------
let last = performance.now(), due = 0;
function frame(now) {
    const pace = byId("pace").valueAsNumber;
    if (running) due += Math.min(0.2, (now - last) / 1000) * pace;
    last = now;
    while (due >= data.time_step_s) {
        due -= data.time_step_s;
        robots.forEach((robot) => robot.step());
        const moved = robots.find((robot) => robot.moved);
        if (moved) for (const key of scene.shared) shared[key] = [...moved.of[`world/${key}`]];
        light();
        drawValues();
    }
    robots.forEach((robot) => draw(robot, due / data.time_step_s));
    requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
// For the tests, and for the browser's console.
globalThis.play = { robots, shared, learned, step, filled, data };
