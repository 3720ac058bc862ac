/** How many notes came since the person last looked. */
export interface Unread {
  seenUntil: number; // time of the newest note that was on screen; 0 before the first
}

interface Note {
  readonly time: number; // of the console's clock; unlike ids, times go on after the console was restarted
  readonly peer: string;
}

export function createUnread(): Unread {
  return { seenUntil: 0 };
}

/** Own notes are never unread. */
export function countUnread(unread: Unread, notes: readonly Note[], me: string | null): number {
  return notes.filter((note) => note.time > unread.seenUntil && note.peer !== me).length;
}

export function markRead(unread: Unread, notes: readonly Note[]): void {
  for (const note of notes) unread.seenUntil = Math.max(unread.seenUntil, note.time);
}
