/** "avc1.42C01F": the codec of an H.264 access unit in Annex B that has a sequence parameter set; null: it has none. */
export function avcCodec(unit: Uint8Array): string | null {
  for (let at = 0; at + 6 < unit.length; at++) {
    if (unit[at] !== 0 || unit[at + 1] !== 0 || unit[at + 2] !== 1) continue;
    if (((unit[at + 3] ?? 0) & 0x1f) !== 7) continue; // H.264 table 7-1: sequence parameter set
    const bytes = unit.subarray(at + 4, at + 7);
    return `avc1.${Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("")}`
      .toUpperCase()
      .replace("AVC1", "avc1");
  }
  return null;
}
