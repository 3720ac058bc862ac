import "./style/console_page.css";
import { readFragment } from "./core/fragment";
import { Page } from "./page";
import { ConsoleApi } from "./rtc/console_api";
import { takeFirst } from "./rtc/first_opening";
import { styled } from "./styled";

const link = readFragment(location.hash);
const page = new Page(new ConsoleApi(link.token ?? ""), link, link.name, takeFirst());
if (link.token === null) page.app.link = { kind: "no_token" };
void styled().then(() => {
  page.start();
  if (link.token !== null) void page.app.connection.run();
});

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
// Any first touch of the page lets it make sound, unless the operator turned it off.
for (const type of ["pointerdown", "keydown"] as const)
  addEventListener(type, () => {
    if (page.app.state.settings.soundWanted && !page.app.audio.isRunning()) page.app.audio.resume();
  });
