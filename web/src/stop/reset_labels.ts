import type { Refusal } from "../protocol/wire";

/** By reason. They come with what the page loads after its first picture: nobody resets a stop before. */
const words: Partial<Record<Refusal["reason"], string>> = {};

export function takeResetWords(found: typeof words): void {
  Object.assign(words, found);
}

export function resetRefusalLabel({ reason, detail }: Refusal): string {
  return words[reason] ?? `Not reset: ${detail === "" ? reason : detail}.`;
}
