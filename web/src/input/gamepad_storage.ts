import { withProfile, type PadProfile } from "../gamepad/profile";
import {
  NO_PROFILES,
  mergeProfiles,
  readProfiles,
  writeProfiles,
  type PadProfiles,
} from "../gamepad/profile_file";

const KEY = "lockstep.pads";

/** The profiles of pads, kept in this browser. What cannot be kept still holds until the page closes. */
export class GamepadStorage {
  saved: PadProfiles = NO_PROFILES;
  /** What is wrong with what is stored, or with storing; null when nothing is. */
  trouble: string | null = null;

  constructor() {
    const text = this.load();
    if (text === null) return;
    const parsed = readProfiles(text);
    if (parsed.kind === "profiles") this.saved = parsed.book;
    else this.trouble = `The stored gamepad profiles were ignored: ${parsed.why}`;
  }

  save(profile: PadProfile): void {
    this.write({ ...this.saved, profiles: withProfile(this.saved.profiles, profile) });
  }

  forget(id: string): void {
    this.write({ ...this.saved, profiles: this.saved.profiles.filter((profile) => profile.id !== id) });
  }

  prefer(id: string): void {
    this.write({ ...this.saved, preferred: id });
  }

  /** Takes the profiles of a file; says what is wrong with it, null when nothing is. */
  import(text: string): string | null {
    const parsed = readProfiles(text);
    if (parsed.kind === "bad") return `This file was not imported: ${parsed.why}`;
    this.write(mergeProfiles(this.saved, parsed.book));
    return null;
  }

  export(): string {
    return writeProfiles(this.saved);
  }

  private write(book: PadProfiles): void {
    this.saved = book;
    try {
      localStorage.setItem(KEY, writeProfiles(book));
      this.trouble = null;
    } catch {
      this.trouble = "This browser stores nothing for this page: the profiles are lost when it closes";
    }
  }

  private load(): string | null {
    try {
      return localStorage.getItem(KEY);
    } catch {
      return null; // storage is switched off; saving will say so
    }
  }
}
