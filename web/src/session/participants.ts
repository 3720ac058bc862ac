import type { Participant, Seat } from "../protocol/wire";

/** The people of a session in the order in which they matter, observers apart. */
export interface SortedParticipants {
  readonly leading: readonly Participant[]; // who drives, you, who may drive
  readonly watching: readonly Participant[]; // the other observers, by name
}

/** What there is to say of a crowd in one line. */
export interface CrowdSummary {
  readonly count: number;
  readonly largestGap: number; // events
  readonly onLowQuality: number;
}

const COLLATOR = new Intl.Collator("en", { numeric: true });

export function sortParticipants(
  participants: readonly Participant[],
  seat: Seat | null,
  me: string | null,
): SortedParticipants {
  const claims = new Set(seat?.claims.map((claim) => claim.peer));
  const rank = (person: Participant): number => {
    if (person.peer === seat?.holder) return 0;
    if (person.peer === me) return 1;
    if (claims.has(person.peer)) return 2;
    if (person.silenced) return 2.5; // it must not be forgotten among many
    if (person.role === "supervisor") return 3;
    return person.role === "operator" ? 4 : 5;
  };
  const ranked = participants
    .map((person) => ({ person, rank: rank(person) }))
    .sort((one, other) => one.rank - other.rank || byName(one.person, other.person));
  return {
    leading: ranked.filter((each) => each.rank < 5).map((each) => each.person),
    watching: ranked.filter((each) => each.rank === 5).map((each) => each.person),
  };
}

export function summarise(people: readonly Participant[]): CrowdSummary {
  return {
    count: people.length,
    largestGap: people.reduce((most, person) => Math.max(most, Math.abs(person.gap)), 0),
    onLowQuality: people.filter((person) => person.tier === "low").length,
  };
}

export function crowdLabel({ count, largestGap, onLowQuality }: CrowdSummary): string {
  const words = [`${count} ${count === 1 ? "observer" : "observers"}`];
  if (largestGap > 0) words.push(`gap up to ${largestGap}`);
  if (onLowQuality > 0) words.push(`${onLowQuality} on the low tier`);
  return words.join(" · ");
}

/** The figures of one person: only those that are known. */
export function participantLabel(person: Participant): string {
  const words: string[] = person.carrier === "none" ? [] : [`gap ${person.gap}`];
  if (person.picture_delay_ms !== null) words.push(`${person.picture_delay_ms.toFixed(0)} ms`);
  else if (person.round_trip_ms !== null) words.push(`${person.round_trip_ms.toFixed(0)} ms RTT`);
  if (person.loss !== null) words.push(lossWords(person.loss));
  if (person.tier !== null) words.push(`${person.tier === "operator" ? "own" : person.tier} tier`);
  words.push(person.carrier === "none" ? "no stamps" : person.carrier);
  return words.join(" · ");
}

function lossWords(share: number): string {
  if (share < 0.0005) return "no loss";
  return `${(share * 100).toFixed(share < 0.0995 ? 1 : 0)} % lost`;
}

function byName(one: Participant, other: Participant): number {
  return COLLATOR.compare(one.name, other.name) || COLLATOR.compare(one.peer, other.peer);
}
