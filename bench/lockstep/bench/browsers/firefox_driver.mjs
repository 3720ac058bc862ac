// Drives Firefox through WebDriver BiDi for Python: one JSON request a line in, one answer a line out. The first line is
// the answer to nothing, once Firefox has begun.
import { createInterface } from "node:readline";
import { createRequire } from "node:module";

const require = createRequire(new URL("../../../../web/package.json", import.meta.url));
const { default: puppeteer } = await import(require.resolve("puppeteer-core"));

const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath: process.argv[2],
  headless: true,
  timeout: 120_000, // ms: read from a cold disk beside other work, it takes more than half a minute to begin
  args: ["--no-sandbox"],
  extraPrefsFirefox: {
    "media.autoplay.default": 0,
    "media.autoplay.blocking_policy": 0,
    "app.update.enabled": false,
    "datareporting.policy.dataSubmissionEnabled": false,
    "network.captive-portal-service.enabled": false,
    "network.connectivity-service.enabled": false,
  },
});
const page = await browser.newPage();
const errors = [];
page.on("pageerror", (error) => errors.push(String(error)));

const verbs = {
  prepare: ({ script }) => page.evaluateOnNewDocument(script).then(() => null),
  open: ({ url }) => page.goto(url).then(() => null),
  evaluate: ({ expression }) => page.evaluate(expression),
  wait: ({ expression, timeout }) => waitFor(expression, timeout),
  key: ({ code, down }) => (down ? page.keyboard.down(code) : page.keyboard.up(code)).then(() => null),
  click: ({ selector }) => page.click(selector).then(() => null),
  screenshot: ({ path }) => page.screenshot({ path }).then(() => null),
  errors: async () => errors,
};

// Asks again and again from here: the page's content security policy forbids evaluating strings inside it.
async function waitFor(expression, timeout) {
  const end = Date.now() + timeout;
  while (!(await page.evaluate(expression))) {
    if (Date.now() > end) throw new Error(`never came true: ${expression}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  return null;
}

console.log(JSON.stringify({ value: null }));
for await (const line of createInterface({ input: process.stdin })) {
  const request = JSON.parse(line);
  try {
    console.log(JSON.stringify({ value: (await verbs[request.verb](request)) ?? null }));
  } catch (error) {
    console.log(JSON.stringify({ error: String(error) }));
  }
}
await browser.close();
