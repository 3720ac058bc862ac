/** How far a picture or a sound is behind the newest feedback, in words. */
export function eventsBehind(count: number): string {
  return count === 1 ? "1 event behind" : `${count} events behind`;
}
