import "./style/console_page.css";
import { readFragment } from "./util/url_fragment";
import { Page } from "./app/page";
import { ConsoleApi } from "./transport/signalling/console_api";
import { takePreconnection } from "./transport/webrtc/preconnection";
import { stylesheetsLoaded } from "./app/stylesheets";

const link = readFragment(location.hash);
const page = new Page(new ConsoleApi(link.token ?? ""), link, link.name, takePreconnection());
if (link.token === null) page.engine.connectionState = { kind: "no_token" };
void stylesheetsLoaded().then(() => {
  page.start();
  if (link.token !== null) void page.engine.connection.run();
});

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
// Any first touch of the page lets it make sound, unless the operator turned it off.
for (const type of ["pointerdown", "keydown"] as const)
  addEventListener(type, () => {
    if (page.engine.state.settings.soundWanted && !page.engine.audio.isRunning()) page.engine.audio.resume();
  });
