import { parseFleet, type FleetRobot } from "../../src/fleet/fleet_status";

/** One robot as the console would tell it: connected, free, heard just now. */
export function robotOf(name: string, rest: Record<string, unknown> = {}): FleetRobot {
  const told = {
    name,
    label: "Planar robot",
    url: `robots/${name}/`,
    link: "up",
    link_age_ms: 60_000,
    event: 12,
    feedback_age_ms: 20,
    participants: [],
    participant_count: 0,
    ...rest,
  };
  const robot = parseFleet({ robots: [told] })?.robots[0];
  if (robot === undefined) throw new Error("no robot");
  return robot;
}
