import "./style/fonts.css";
import "./style/base.css";
import "./style/layout.css";
import "./style/panels.css";
import "./style/deck.css";
import "./style/views.css";
import "./style/gauges.css";
import "./style/overlay.css";
import "./style/controls.css";
import "./style/seat.css";
import "./style/talk.css";
import "./style/crowded_views.css";
import "./style/tabs.css";
import "./style/people.css";
import "./style/notes.css";
import "./style/sheets.css";
import "./style/invite.css";
import "./style/audit.css";
import "./style/small_screens.css";
import "./style/landscape.css";
import "./style/short_phones.css";
import "./style/charts.css";
import "./style/staleness.css";
import "./style/limits.css";
import "./style/places.css";
import "./style/scale_bar.css";
import "./style/pads.css";
import "./style/layers.css";
import "./style/record.css";
import "./style/way_back.css";
import "./style/forced_colors.css";
import { readFragment } from "./core/fragment";
import { installHook } from "./lockstep_hook";
import { Page } from "./page";
import { ConsoleApi } from "./rtc/console_api";

const link = readFragment(location.hash);
const page = new Page(new ConsoleApi(link.token ?? ""), link, link.name);
installHook(page);
if (link.token === null) page.app.link = { kind: "no_token" };
else void page.app.connection.run();
page.start();

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
// Any first touch of the page lets it make sound, unless the operator turned it off.
for (const type of ["pointerdown", "keydown"] as const)
  addEventListener(type, () => {
    if (page.app.state.settings.soundWanted && !page.app.audio.isRunning()) page.app.audio.resume();
  });
