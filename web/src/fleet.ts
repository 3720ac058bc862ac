import "./style/fleet_page.css";
import { readFragment } from "./util/url_fragment";
import { installFleetHook } from "./fleet/view/fleet_hook";
import { FleetPage } from "./fleet/view/fleet_page";
import { ConsoleApi } from "./transport/signalling/console_api";
import { watchTouch } from "./ui/elements/touch_detection";

const link = readFragment(location.hash);
const page = new FleetPage(new ConsoleApi(link.token ?? ""), link);
installFleetHook(page);
watchTouch();
page.start();

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
