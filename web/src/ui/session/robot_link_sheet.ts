import type { RobotLinkApi } from "../../transport/signalling/robot_link_api";
import { h } from "../elements/dom";
import type { SheetContent } from "../elements/sheet";
import { createRobotLinkCard } from "./robot_link_card";

/** Robots that dial in, each with its name; one without a name is the only robot of its console. */
export function createRobotLinkSheet(robots: readonly (readonly [string, RobotLinkApi])[]): SheetContent {
  const cards = robots.map(([name, api]) => createRobotLinkCard(api, name));
  const note = h(
    "p",
    "muted",
    {},
    "Whoever types the code at a robot hands that robot to this console. To forget a robot ends its link at once; it comes to rest by itself.",
  );
  return {
    name: "robot-links",
    title: robots.length === 1 ? "Robot link" : "Robot links",
    element: h("div", "sheet-body", {}, ...cards.map((each) => each.element), note),
    opened: () => cards.forEach((each) => each.refresh()),
    closed: () => cards.forEach((each) => each.stop()),
  };
}
