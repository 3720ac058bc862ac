import type { Claim, Role, SeatStatus } from "./seat_status";

/** What the seat's bar says. `asked`: an answer is wanted of this page. */
export interface SeatLabels {
  readonly tone: "off" | "free" | "mine" | "asked" | "idle";
  readonly title: string;
  readonly text: string;
}

/** What keeps a holder from driving now. */
export type Obstacle = "silent" | "robot_down" | "locked_out" | "stopped";

const OBSTACLE_WORDS: Readonly<Record<Obstacle, string>> = {
  silent: "The console is silent, and frees your seat if it does not hear this page",
  robot_down: "The robot cannot be reached",
  locked_out: "Somebody at the robot has locked it",
  stopped: "Reset the robot, then arm to drive",
};

export interface SeatView {
  readonly role: Role | null; // null while not connected
  readonly status: SeatStatus;
  readonly holder: string; // name
  readonly policy: boolean; // the holder is one
  readonly claims: readonly Claim[];
  readonly me: string | null;
  readonly idleSeconds: number | null;
  readonly armed: boolean;
  readonly obstacle: Obstacle | null;
  readonly notice: string | null; // the last hand-over, while it is fresh
}

export function seatLabels(view: SeatView): SeatLabels {
  switch (view.status) {
    case "unknown":
      return { tone: "off", title: "Control seat", text: "Not connected" };
    case "free":
      return { tone: "free", title: "Nobody drives", text: view.notice ?? freeWords(view.role) };
    case "mine":
      return holderWords(view);
    case "asked":
    case "held":
      return {
        tone: "off",
        title: `${view.policy ? "Policy " : ""}${view.holder} drives`,
        text: view.notice ?? waitingWords(view),
      };
  }
}

function holderWords(view: SeatView): SeatLabels {
  const [first, ...more] = view.claims;
  if (first !== undefined) {
    const others = more.length === 0 ? "" : ` · ${more.length} more ${more.length === 1 ? "waits" : "wait"}`;
    return {
      tone: "asked",
      title: `${first.name} asks for control`,
      text: `${first.secondsLeft} s to answer${others}`,
    };
  }
  if (view.obstacle === "silent")
    return { tone: "off", title: "You had control", text: OBSTACLE_WORDS.silent };
  if (view.idleSeconds !== null) {
    return {
      tone: "idle",
      title: "No movement for a while",
      text: `Control is given back in ${view.idleSeconds} s`,
    };
  }
  const next = view.obstacle === null ? (view.armed ? "" : "Arm to drive") : OBSTACLE_WORDS[view.obstacle];
  return { tone: "mine", title: "You have control", text: [view.notice, next].filter(Boolean).join(". ") };
}

function freeWords(role: Role | null): string {
  if (role === "observer") return "You watch, and may stop the robot at any time";
  return "The control seat is free";
}

/** What somebody reads who does not drive: their own request first, then others' and the holder's idleness. */
function waitingWords(view: SeatView): string {
  const mine = view.claims.find((claim) => claim.peer === view.me);
  if (mine !== undefined) return `You have asked: ${mine.secondsLeft} s to answer`;
  if (view.idleSeconds !== null) return `${view.holder} is idle: control is free in ${view.idleSeconds} s`;
  const [first, ...more] = view.claims;
  if (first !== undefined) {
    const others = more.length === 0 ? "" : ` and ${more.length} more`;
    return `${first.name}${others} asked for control: ${first.secondsLeft} s to answer`;
  }
  if (view.role === "observer") return "You watch, and may stop the robot at any time";
  return view.role === "supervisor" ? "You watch, and may take control at once" : "";
}
