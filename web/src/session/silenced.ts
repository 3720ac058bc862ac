import type { Participant } from "../protocol/wire";

/** Whether this peer's link may not stop the robot for now. */
export function isSilenced(participants: readonly Participant[], peer: string | null): boolean {
  return participants.some((person) => person.peer === peer && person.silenced);
}
