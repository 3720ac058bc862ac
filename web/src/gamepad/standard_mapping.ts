/** Only the standard mapping says which button is which; other pads are calibrated first. */
export function isStandard(pad: { readonly mapping: string }): boolean {
  return pad.mapping === "standard";
}
