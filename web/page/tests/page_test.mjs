// The page in a real browser: climb.html from the disk, a recording and a live run from `clamber web`,
// which is killed and started again in between. Pictures are judged by their colours, not pixel by
// pixel. Usage: page_test.mjs CLAMBER CLIMB_FOLDER
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, statSync, truncateSync, writeFileSync } from "node:fs";
import { request } from "node:http";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const SKIPPED = 77;
const PATIENCE = 120000; // ms: of a machine that draws in software and does much else beside
const [clamber, climb] = process.argv.slice(2);
const browserFile = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!existsSync(browserFile)) {
  console.log(`skipped: no ${browserFile} (Debian: chromium)`);
  process.exit(SKIPPED);
}
const folder = mkdtempSync(join(tmpdir(), "clamber_page_"));
const domain = String(110 + (process.pid % 100)); // of its own, beside other tests
const environment = { ...process.env, CLAMBER_DDS_DOMAIN: domain };
const operator = join(folder, "operator.sock");
const children = new Set();

function start(...given) {
  const child = spawn(clamber, given, { env: environment, stdio: ["ignore", "pipe", "pipe"] });
  child.text = "";
  for (const stream of [child.stdout, child.stderr]) stream.on("data", (part) => (child.text += part));
  child.ended = new Promise((resolve) => child.on("exit", (code) => resolve(code)));
  children.add(child);
  return child;
}

async function until(what, check, most = PATIENCE) {
  const end = Date.now() + most;
  for (;;) {
    const value = await check();
    if (value) return value;
    assert.ok(Date.now() < end, `within ${most} ms: ${typeof what === "function" ? await what() : what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** Says so to the robot, as its operator. */
async function tell(robot, command) {
  await until(() => `${command}: ${robot.text}`,
              () => spawnSync(clamber, [command, "--socket", operator]).status === 0);
}

/** Starts `clamber web`. @returns the child, its address and its port */
async function serve(...given) {
  const child = start("web", ...given);
  const found = await until(() => `an address in: ${child.text}`, () => child.text.match(/http:\/\/127\.0\.0\.1:(\d+)\/\S*/));
  return { child, address: found[0], port: Number(found[1]) };
}

async function stop(child, signal = "SIGTERM") {
  child.kill(signal);
  await child.ended;
  children.delete(child);
}

/** Shares of the picture that are wood, blue, orange, violet or green arrows, the red of a fault. */
async function colours(page, part = "#scene") {
  const png = (await page.locator(part).screenshot()).toString("base64");
  return page.evaluate(async (data) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
    const paint = new OffscreenCanvas(image.width, image.height).getContext("2d");
    paint.drawImage(image, 0, 0);
    const { data: bytes } = paint.getImageData(0, 0, image.width, image.height);
    const count = { wood: 0, blue: 0, orange: 0, violet: 0, green: 0, red: 0 };
    for (let i = 0; i < bytes.length; i += 4) {
      const [r, g, b] = bytes.subarray(i, i + 3);
      if (r > 170 && g < 80 && b < 80) count.red += 1;
      else if (b > r + 50 && b > g + 25 && r < 0.8 * g) count.blue += 1;
      else if (r > 1.5 * g && r > 2 * b) count.orange += 1;
      else if (r > g + 15 && g > b + 15) count.wood += 1;
      else if (r > g + 30 && b > g + 50) count.violet += 1;
      else if (g > r + 50 && g > b + 30) count.green += 1;
    }
    for (const name of Object.keys(count)) count[name] /= bytes.length / 4;
    return { share: count, hash: bytes.reduce((sum, byte) => (sum * 31 + byte) | 0, 0) };
  }, png);
}

const number = (page, id) => page.locator(`#${id}`).textContent();
const rows = async (page) => Number(await page.evaluate(() => document.body.dataset.rows ?? 0));

/** What the page says of the run at the time that it shows. */
async function told(page) {
  const texts = {};
  for (const id of ["worst", "phase", "mode", "fault", "event"]) texts[id] = await number(page, id);
  assert.doesNotMatch(texts.phase, /^phase \d/, "a phase has a name");
  assert.match(texts.mode, /^(moving to start|executing|paused|holding)/);
  assert.equal(texts.fault, "");
  assert.match(texts.event, /^\d+\.\d\d s (plan|mode|phase): /);
  return texts;
}

async function scrub(page, time) {
  const before = await page.evaluate(() => Number(document.getElementById("scene").dataset.pictures ?? 0));
  await page.evaluate((to) => {
    const scrubber = document.getElementById("scrub");
    scrubber.value = to;
    scrubber.dispatchEvent(new Event("input"));
  }, time);
  await page.waitForFunction(
    (drawn) => Number(document.getElementById("scene").dataset.pictures ?? 0) > drawn, before);
}

function showsTheRobot({ share }) {
  assert.ok(share.wood > 0.02, `an obstacle of wood: ${JSON.stringify(share)}`);
  assert.ok(share.blue > 0.002 && share.orange > 0.0007, `a robot's limbs: ${JSON.stringify(share)}`);
}

async function opened(browser) {
  const page = await browser.newPage({ viewport: { width: 900, height: 640 } });
  page.setDefaultTimeout(PATIENCE);
  page.requests = [];
  page.errors = [];
  page.on("request", (each) => page.requests.push(each.url()));
  page.on("pageerror", (error) => page.errors.push(error.message));
  return page;
}

async function embedded(browser) {
  const page = await opened(browser);
  const url = pathToFileURL(join(climb, "climb.html")).href;
  await page.goto(url);
  await until("rows", async () => (await rows(page)) > 500);
  const size = statSync(join(climb, "climb.html")).size;
  assert.ok(size < 6e6, `climb.html has ${size} bytes`);
  await scrub(page, 2);
  const early = { ...(await colours(page)), phase: await number(page, "phase") };
  showsTheRobot(early);
  assert.ok(early.share.violet > 0.0005, `forces of the floor: ${JSON.stringify(early.share)}`);
  await scrub(page, 1e6);
  const late = { ...(await colours(page)), phase: await number(page, "phase") };
  showsTheRobot(late);
  assert.ok(late.share.green > 0.0003, `forces of the obstacle: ${JSON.stringify(late.share)}`);
  assert.notEqual(early.hash, late.hash, "scrubbing changes the picture");
  assert.notEqual(early.phase, late.phase, "scrubbing changes the phase");
  await scrub(page, 10);
  const at10 = await told(page);
  assert.match(at10.event, /s phase: phase \d+: \w/);
  assert.ok((await colours(page, "#timeline")).share.red < 1e-5, "no fault on the timeline");
  assert.deepEqual(page.requests.filter((each) => !each.startsWith("data:")), [url], "nothing is fetched");
  assert.deepEqual(page.errors, []);

  // The same with an event that it did not have.
  const text = readFileSync(join(climb, "climb.html"), "utf8");
  const fault = '{"time":7.5,"kind":1,"severity":2,"joint":0,"text":"tracking error"}';
  const troubled = join(folder, "troubled.html");
  writeFileSync(troubled, text.replace(/"events":\[.*?\]/, `"events":[${fault}]`));
  await page.goto(pathToFileURL(troubled).href);
  await until("rows", async () => (await rows(page)) > 500);
  await scrub(page, 10);
  assert.match(await number(page, "event"), /^7\.50 s fault: tracking error at \w+$/);
  assert.ok((await colours(page, "#timeline")).share.red > 1e-5, "a fault on the timeline");
  await page.close();
  return at10;
}

async function recorded(browser, expected) {
  const file = join(folder, "run.mcap");
  const exported = spawnSync(clamber, ["export", join(climb, "climb.log"), "--to", file]);
  assert.equal(exported.status, 0, String(exported.stderr));
  truncateSync(file, Math.floor(0.25 * statSync(file).size)); // as its recorder's death would
  const { child, address, port } = await serve(file, "--port", "0");
  const page = await opened(browser);
  await page.goto(address);
  await until(() => number(page, "status"), async () => (await rows(page)) > 500);
  assert.match(await number(page, "status"), /end is missing/);
  await scrub(page, 10);
  assert.deepEqual(await told(page), expected, "a recording shows what the embedded run shows");
  showsTheRobot(await colours(page));

  await page.goto(`http://127.0.0.1:${port}/?file=http://192.0.2.1/run.mcap`);
  await until("a refusal", async () => (await number(page, "status")).includes("only files of this server"));
  assert.ok(!page.requests.some((each) => each.includes("192.0.2.1/run") && !each.includes("?file=")));
  assert.deepEqual(page.errors, []);
  await page.close();
  await answersOnlyItsOwn(port);
  await stop(child);
}

function ask(port, options) {
  return new Promise((resolve, reject) => {
    const asked = request({ host: "127.0.0.1", port, ...options }, (answer) => {
      answer.resume();
      answer.on("end", () => resolve(answer.statusCode));
    });
    asked.on("error", reject);
    asked.end();
  });
}

async function answersOnlyItsOwn(port) {
  assert.equal(await ask(port, { path: "/" }), 200);
  assert.equal(await ask(port, { path: "/", headers: { Host: `localhost:${port}` } }), 200);
  for (const host of ["evil.example", `evil.example:${port}`, "127.0.0.1"])
    assert.equal(await ask(port, { path: "/", headers: { Host: host } }), 403, `Host: ${host}`);
  assert.equal(await ask(port, { path: "/", method: "POST" }), 405);
  assert.equal(await ask(port, { path: "/../../etc/passwd" }), 404);
  assert.equal(await ask(port, { path: "/live" }), 404, "a file has no live data");
  const second = spawnSync(clamber, ["web", "--port", String(port)], { env: environment });
  assert.equal(second.status, 2);
  assert.match(String(second.stderr), /in use/);
}

const memory = (child) => Number(readFileSync(`/proc/${child.pid}/status`, "utf8").match(/VmRSS:\s+(\d+)/)[1]);

async function live(browser, robot) {
  let server = await serve("--port", "0");
  const page = await opened(browser);
  await page.goto(server.address);
  await tell(robot, "arm");
  await tell(robot, "start");
  const recorder = start("record", "-o", join(folder, "live.mcap"), "--duration", "1");
  await until(() => robot.text + server.child.text, async () => (await rows(page)) > 50);
  await tell(robot, "pause"); // which lasts however slow this machine is; frames go on
  assert.equal(await number(page, "source"), "live");
  await told(page);
  // Browsers that never read.
  const before = memory(server.child);
  const stalled = Array.from({ length: 4 }, () => {
    const socket = connect(server.port, "127.0.0.1");
    socket.on("error", () => {});
    socket.pause();
    socket.write(`GET /live HTTP/1.1\r\nHost: 127.0.0.1:${server.port}\r\n\r\n`);
    return socket;
  });
  const first = { ...(await colours(page)), time: await number(page, "time") };
  showsTheRobot(first);
  assert.equal(await recorder.ended, 0, recorder.text);
  const frames = Number(recorder.text.match(/(\d+) frames/)[1]);
  assert.ok(frames > 700, recorder.text);
  const grown = await rows(page);
  await until("more rows", async () => (await rows(page)) > grown + 20);
  assert.notEqual(await number(page, "time"), first.time, "numbers move");
  assert.ok(memory(server.child) < before + 20000, "who does not read costs no memory");
  for (const socket of stalled) socket.destroy();

  const other = await opened(browser);
  await other.goto(server.address);
  await other.setInputFiles("#file", join(folder, "live.mcap"));
  await until(() => number(other, "status"), async () => (await number(other, "source")) === "live.mcap");
  assert.equal(await number(other, "status"), "", "a whole recording");
  assert.ok((await rows(other)) > 35);
  await told(other); // with names and events of before the recorder came
  await other.close();

  await stop(server.child, "SIGKILL");
  await until("a lost connection", async () => (await number(page, "source")).includes("lost"));
  server = await serve("--port", String(server.port));
  await until("live again", async () => (await number(page, "source")) === "live");
  const again = await rows(page);
  await until("rows again", async () => (await rows(page)) > again + 20);
  assert.deepEqual(page.errors, []);
  await stop(robot, "SIGKILL");
  await until("word of nobody", async () => (await number(page, "status")).includes("nobody publishes"));
  await page.close();
  await stop(server.child);
}

const browser = await chromium.launch({
  executablePath: browserFile,
  args: [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
  ],
});
try {
  const part = async (name, work) => {
    const from = Date.now();
    const result = await work();
    console.log(`${name}: good, ${((Date.now() - from) / 1000).toFixed(1)} s`);
    return result;
  };
  const at10 = await part("climb.html", () => embedded(browser));
  const robot = start("run", join(climb, "plan.json"), "--realtime", "-o", join(folder, "run.log"),
                      "--operator", operator);  // needs seconds to start
  await part("recording", () => recorded(browser, at10));
  await part("live", () => live(browser, robot));
} finally {
  await browser.close();
  for (const child of children) child.kill("SIGKILL");
  rmSync(folder, { recursive: true, force: true });
}
