const CANDIDATE = "a=candidate:";
const END = "a=end-of-candidates";

/**
 * What a PATCH says of our side (RFC 8840 9): the credentials and candidates of a local description. Candidates whose
 * address is an mDNS name are left out: they say nothing to the console.
 */
export function iceFragment(sdp: string, complete: boolean): string {
  const lines = sdp.split(/\r?\n/);
  const first = (start: string): string[] => lines.filter((line) => line.startsWith(start)).slice(0, 1);
  const candidates = iceCandidates(sdp);
  const head = [...first("a=ice-ufrag:"), ...first("a=ice-pwd:"), ...first("m="), ...first("a=mid:")];
  return [...head, ...candidates, ...(complete ? [END] : []), ""].join("\r\n");
}

/** The candidates that say where we are; all sections of a bundle have the same. */
export function iceCandidates(sdp: string): string[] {
  const lines = sdp.split(/\r?\n/).filter((line) => line.startsWith(CANDIDATE) && !line.includes(".local "));
  return [...new Set(lines)];
}

/** The other side's description after an ICE restart: as before, with the credentials and candidates of `fragment`. */
export function restartedAnswer(answer: string, fragment: string): string | null {
  const given = fragment.split(/\r?\n/);
  const username = given.find((line) => line.startsWith("a=ice-ufrag:"));
  const password = given.find((line) => line.startsWith("a=ice-pwd:"));
  if (username === undefined || password === undefined) return null;
  const candidates = given.filter((line) => line.startsWith(CANDIDATE) || line === END);
  const found: string[] = [];
  let placed = false;
  for (const line of answer.split(/\r?\n/)) {
    if (line.startsWith(CANDIDATE) || line === END) continue;
    if (line.startsWith("a=ice-ufrag:")) found.push(username);
    else if (line.startsWith("a=ice-pwd:")) {
      found.push(password);
      if (!placed) found.push(...candidates); // the first section is the bundle's
      placed = true;
    } else found.push(line);
  }
  return found.join("\r\n");
}
