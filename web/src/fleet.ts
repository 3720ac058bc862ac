import "./style/fleet_page.css";
import { readFragment } from "./core/fragment";
import { installFleetHook } from "./fleet/fleet_hook";
import { FleetPage } from "./fleet/fleet_page";
import { ConsoleApi } from "./rtc/console_api";
import { watchTouch } from "./ui/touch_mark";

const link = readFragment(location.hash);
const page = new FleetPage(new ConsoleApi(link.token ?? ""), link);
installFleetHook(page);
watchTouch();
page.start();

// Another link pasted into the same tab changes only the fragment.
addEventListener("hashchange", () => location.reload());
