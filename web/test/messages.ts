import type {
  Axis,
  Feedback,
  Refusal,
  RobotDescription,
  RobotState,
  Seat,
  StopState,
  Welcome,
} from "../src/protocol/wire";

export function stopOf(rest: Partial<StopState> = {}): StopState {
  return { stopped: false, by: "", reason: "", number: 0, press: "", kept: true, locked_out: "", ...rest };
}

export function feedbackOf(event: number, rest: Partial<Feedback> = {}): Feedback {
  return {
    type: "feedback",
    event,
    issue: 1,
    time: 0,
    axes: [0, 0],
    joints: [],
    goals: [],
    wrench: [],
    ranges: [],
    at_rest: true,
    stop: stopOf(),
    faults: [],
    limits: [],
    unknown: [],
    nonce: 0,
    neutral_needed: false,
    warning: 0,
    ...rest,
  };
}

export function refusalOf(event: number, reason: Refusal["reason"]): Refusal {
  return { type: "refusal", event, reason, current: 1, detail: "", stop: 0 };
}

export function axisOf(name: string, rest: Partial<Axis> = {}): Axis {
  return {
    ...{ name, label: name, unit: "m/s", minimum: -1, maximum: 2, slew: 1, brake: 1, rest: 0 },
    ...{ kind: "rate", acceleration: 0, reach: 0, wrap: null, grips: false },
    ...rest,
  };
}

export function goalAxisOf(name: string, rest: Partial<Axis> = {}): Axis {
  return axisOf(name, { unit: "rad", minimum: -2, kind: "goal", acceleration: 4, reach: 0.5, ...rest });
}

export function descriptionOf(axes: readonly Axis[]): RobotDescription {
  return {
    name: "test",
    label: "Test robot",
    axes,
    joints: [],
    layers: [],
    cameras: [],
    microphones: [],
    wrench: null,
    ranges: null,
    bodies: [],
    position_limits: [],
    planar_base: null,
    geofences: [],
    force_feeling: null,
    start_warning: null,
    watchdog: null,
    body_twists: [],
    poses: [],
    actions: [],
    map: null,
    hold: 0.3,
    max_event_age: 2,
    max_event_rate: 25,
  };
}

export function robotOf(link: RobotState["link"], detail = ""): RobotState {
  return { type: "robot", link, epoch: "e", description: descriptionOf([axisOf("x")]), detail };
}

export function welcomeOf(role: Welcome["role"]): Welcome {
  return { type: "welcome", peer: "me", role, name: "somebody", streams: [], voice: "" };
}

const NOT_OFFERED = { offered: false, offered_to: "", offered_by: "" };

export function seatOf(holder: string, name = ""): Seat {
  return {
    type: "seat",
    holder,
    name,
    why: "",
    kind: holder === "" ? "none" : "human",
    claims: [],
    idle_seconds_left: null,
    ...NOT_OFFERED,
  };
}
