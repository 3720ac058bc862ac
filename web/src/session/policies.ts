import type { Participant, RobotDescription, Seat, ShadowVerdict } from "../protocol/wire";
import type { Role } from "./seat/seat_status";

/** What the bar of policies says, and what one press does. */
export interface PolicyView {
  readonly tone: "off" | "ready" | "offered" | "drives" | "slow";
  readonly title: string;
  readonly text: string;
  readonly takesOver: boolean; // "Take over" is offered
  readonly withdraws: boolean; // "Withdraw the offer" is
  readonly offers: readonly PolicyOffer[]; // a policy each that may be given the seat
}

export interface PolicyOffer {
  readonly peer: string;
  readonly label: string;
}

export interface PolicyConditions {
  readonly role: Role | null;
  readonly me: string | null;
  readonly seat: Seat | null;
  readonly participants: readonly Participant[];
  readonly silentMs: number; // since the last event
  readonly stopped: boolean;
}

/** A policy that has sent no command for so long is said to be slow: it keeps the robot at rest meanwhile. */
export const SLOW_MS = 1000;
const SHOWN_OFFERS = 3;
const NOTHING: PolicyView = {
  tone: "off",
  title: "",
  text: "",
  takesOver: false,
  withdraws: false,
  offers: [],
};

/** Null when there is nothing to say: no policy is here and none may drive. */
export function policyView(conditions: PolicyConditions): PolicyView | null {
  const { role, me, seat, participants, silentMs, stopped } = conditions;
  const mayDrive = role === "operator" || role === "supervisor";
  if (seat === null || me === null) return null;
  if (seat.kind === "policy") {
    const isSlow = silentMs >= SLOW_MS;
    const slow = `It has sent no command for ${(silentMs / 1000).toFixed(1)} s`;
    const by = seat.offered_by === "" ? "" : `${seat.offered_by} lets it`;
    const tone = isSlow ? "slow" : "drives";
    const title = `Policy ${seat.name} drives`;
    return { ...NOTHING, tone, title, text: isSlow ? slow : by, takesOver: mayDrive };
  }
  const policies = participants.filter((each) => each.role === "policy");
  if (seat.offered) {
    const named = policies.find((each) => each.peer === seat.offered_to)?.name ?? "a policy";
    return {
      ...NOTHING,
      tone: "offered",
      title: "Offered to policies",
      text: policies.length === 0 ? "No policy is connected" : `Waiting for ${named}`,
      withdraws: mayDrive,
    };
  }
  if (policies.length === 0) return null;
  const isMine = seat.holder === me;
  const isFree = seat.holder === "";
  const names = policies.map((each) => each.name).join(", ");
  const title = `${names} ${policies.length === 1 ? "is" : "are"} connected`;
  const view: PolicyView = { ...NOTHING, tone: "ready", title };
  if (!mayDrive || !(isMine || isFree)) return view;
  if (stopped) return { ...view, text: "Reset the robot before a policy may drive" };
  if (seat.claims.length > 0) return { ...view, text: "Answer the request for control first" };
  const verb = isMine ? "Give to" : "Let drive:";
  const offers = policies
    .slice(0, SHOWN_OFFERS)
    .map(({ peer, name }) => ({ peer, label: `${verb} ${name}` }));
  return { ...view, offers };
}

/** One axis of a shadow: where it wants the axis to be, and what is done, each as a share of the axis' range. */
export interface ShadowAxis {
  readonly label: string;
  readonly wanted: number | null; // null: as it is
  readonly done: number;
}

/** Of a shadow's values; none if they do not fit the robot. `done`: applied goals or measured values. */
export function shadowAxes(
  description: RobotDescription,
  names: ReadonlySet<string>,
  verdict: ShadowVerdict,
  done: readonly (number | null | undefined)[],
): ShadowAxis[] {
  if (verdict.values.length !== description.axes.length) return [];
  return description.axes.flatMap((axis, index) => {
    if (!names.has(axis.name)) return [];
    const share = (value: number): number =>
      Math.min(1, Math.max(0, (value - axis.minimum) / (axis.maximum - axis.minimum || 1)));
    const wanted = verdict.values[index] ?? null;
    return [
      {
        label: axis.label,
        wanted: wanted === null ? null : share(wanted),
        done: share(done[index] ?? axis.rest),
      },
    ];
  });
}

const JUDGEMENT_WORDS: Readonly<Record<ShadowVerdict["judgement"], string>> = {
  in_time: "",
  late: "too late",
  unseen: "answers a feedback that it has not seen",
  wrong_size: "has not one value per axis",
  not_a_number: "is no number",
  out_of_limits: "outside of the limits",
};

/** What a shadow is judged to be, in words. */
export function shadowWords(verdict: ShadowVerdict): string {
  const words = JUDGEMENT_WORDS[verdict.judgement];
  if (words !== "") return words;
  return verdict.difference === null
    ? ""
    : `${Math.round(100 * (1 - Math.min(1, verdict.difference)))} % as done`;
}
