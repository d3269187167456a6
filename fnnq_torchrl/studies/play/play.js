const data = JSON.parse(document.getElementById("data").textContent);
const world = data.world;
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
        this.caught = this.missed = 0;
        this.reach = half;
        this.begin();
    }

    learn(weights) {
        for (const [key, numbers] of Object.entries(weights)) this.of[`weights/${key}`].set(numbers);
    }

    begin() {
        for (const key of ["x_m", "y_m", "heading_rad"]) this.of[`world/${key}`][0] = 0;
        this.of["world/seed"][0] = BigInt(Math.floor(Math.random() * 2 ** 31));
        this.trail = [];
        // A step at rest: the head looks at the ball, and the robot stays where it is.
        const speed = this.of.speed_mps[0];
        this.of.speed_mps[0] = 0;
        this.hold();
        step(this.leaf);
        this.of.speed_mps[0] = speed;
        this.of["world/step"][0] = 0n;
        this.wait = 0;
        this.before = this.after = this.pose();
        this.seen = this.of["world/bearing"][0];
    }

    // Copy the ball, which both robots share, into the robot's world.
    hold() {
        for (const [key, number] of Object.entries(ball)) this.of[`world/${key}`][0] = number;
    }

    pose() {
        return ["x_m", "y_m", "heading_rad"].map((key) => this.of[`world/${key}`][0]);
    }

    // One step of the world; after a catch or a miss the robot waits, then starts again.
    step() {
        this.moved = false;
        if (this.wait > 0) {
            this.wait -= 1;
            if (this.wait === 0) this.begin();
            return;
        }
        this.hold();
        this.before = this.pose();
        this.seen = this.of["world/bearing"][0];
        step(this.leaf);
        this.after = this.pose();
        this.moved = true;
        this.trail.push(this.after);
        if (this.of.done[0]) {
            this.of.success[0] ? (this.caught += 1) : (this.missed += 1);
            this.wait = 12;
        }
        this.told.textContent = `${this.caught} caught, ${this.missed} missed`;
    }
}

const ball = {};
let start = 0;

function rollAgain() {
    Object.assign(ball, data.starts[start % data.starts.length]);
    start += 1;
}

rollAgain();
const half = world.circle_radius_m + 0.4;
const robots = [new Robot("before"), new Robot("after")];
const learned = robots[1];

// -- pictures --------------------------------------------------------------------------------------
function draw(robot, share) {
    const canvas = robot.canvas, at = canvas.getContext("2d"), size = canvas.width;
    const reach = Math.max(half, ...robot.after.slice(0, 2).map((x) => Math.abs(x) + 0.4));
    robot.reach += 0.1 * (reach - robot.reach); // the picture widens for a robot that drives away
    const scale = size / (2 * robot.reach);
    at.setTransform(1, 0, 0, 1, 0, 0);
    at.clearRect(0, 0, size, size);
    at.setTransform(0, -scale, -scale, 0, size / 2, size / 2); // ahead, the x axis, is up
    const [x, y, heading] = robot.before.map((from, n) => from + share * (robot.after[n] - from));
    const view = world.field_of_view_rad;
    at.fillStyle = colour("view");
    sector(at, x, y, 20, heading - view, heading + view);
    at.lineWidth = 2 / scale;
    at.strokeStyle = colour("line");
    at.setLineDash([6 / scale, 6 / scale]);
    at.beginPath();
    at.arc(0, 0, world.circle_radius_m, 0, 2 * Math.PI);
    at.stroke();
    at.setLineDash([]);
    at.strokeStyle = colour("robot");
    path(at, [[0, 0], ...robot.trail.slice(0, -1), [x, y]]);
    const done = robot.wait > 0;
    robotAt(at, [x, y, heading], {
        radius: world.catch_distance_m,
        track: world.track_width_m,
        scale,
        edge: done ? colour(robot.of.success[0] ? "good" : "bad") : colour("robot"),
        width: done ? 6 : 3,
    });
    at.fillStyle = colour("ball");
    disc(at, ball.ball_x_m, ball.ball_y_m, 0.09);
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
    const bearing = learned.seen, steer = learned.of.action[0];
    const side = (x, left, right) => (Math.abs(x) < 0.005 ? "ahead" : x > 0 ? left : right);
    const seen = `The head sees the ball at ${bearing.toFixed(2)} rad (${side(bearing, "left", "right")}).`;
    const does = `The highest value has ${data.action} ${steer.toFixed(1)} (${side(steer, "to the right", "to the left")}).`;
    if (!data.rules) return `${seen} ${does}`;
    const fired = [...learned.of.fired], most = fired.indexOf(Math.max(...fired));
    const value = number(learned.of["weights/weight"][most]);
    return `${seen} ${does} The rule that fires most: ${data.rules.sentences[most]} ${value}.`;
}

const number = (x) => Number(x.toPrecision(4)).toString();

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

// -- the ball in the reader's hand -----------------------------------------------------------------
function take(x, y) {
    Object.assign(ball, { held: 1, ball_x_m: clamp(x), ball_y_m: clamp(y) });
}
const clamp = (x) => Math.max(-half, Math.min(half, x));

for (const robot of robots) {
    const canvas = robot.canvas;
    const move = (event) => {
        const box = canvas.getBoundingClientRect(), scale = box.width / (2 * robot.reach);
        take(robot.reach - (event.clientY - box.top) / scale, robot.reach - (event.clientX - box.left) / scale);
    };
    canvas.addEventListener("pointerdown", (event) => {
        canvas.setPointerCapture(event.pointerId);
        move(event);
    });
    canvas.addEventListener("pointermove", (event) => event.buttons && move(event));
    canvas.addEventListener("keydown", (event) => {
        const by = { ArrowUp: [0.1, 0], ArrowDown: [-0.1, 0], ArrowLeft: [0, 0.1], ArrowRight: [0, -0.1] }[event.key];
        if (!by) return;
        event.preventDefault();
        take(ball.ball_x_m + by[0], ball.ball_y_m + by[1]);
    });
}

// -- the controls ----------------------------------------------------------------------------------
const units = { speed_mps: "m/s", bearing_noise_rad: "rad", pace: "times as fast" };
for (const [id, unit] of Object.entries(units)) {
    const dial = byId(id), told = document.querySelector(`output[for=${id}]`);
    const tell = () => (told.textContent = `${dial.value} ${unit}`);
    if (id !== "pace") {
        dial.value = learned.of[id][0];
        dial.addEventListener("input", () => robots.forEach((robot) => (robot.of[id][0] = dial.valueAsNumber)));
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
byId("roll").addEventListener("click", () => {
    rollAgain();
    robots.forEach((robot) => robot.begin());
});

// -- time ------------------------------------------------------------------------------------------
let last = performance.now(), due = 0;
function frame(now) {
    const pace = byId("pace").valueAsNumber;
    if (running) due += Math.min(0.2, (now - last) / 1000) * pace;
    last = now;
    while (due >= world.time_step_s) {
        due -= world.time_step_s;
        robots.forEach((robot) => robot.step());
        const moved = robots.find((robot) => robot.moved);
        if (moved) for (const key of Object.keys(ball)) ball[key] = moved.of[`world/${key}`][0];
        light();
        drawValues();
    }
    robots.forEach((robot) => draw(robot, due / world.time_step_s));
    requestAnimationFrame(frame);
}
requestAnimationFrame(frame);
// For the tests, and for the browser's console.
globalThis.play = { robots, ball, learned, step, filled, data };
