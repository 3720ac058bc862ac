/** The console's data channels, and how an offer names them (RFC 8864): none waits for a message that opens it. */
export type ChannelName = "control" | "session" | "stop";

interface AgreedChannel {
  readonly id: number;
  readonly options: RTCDataChannelInit;
}

export const AGREED_CHANNELS: Readonly<Record<ChannelName, AgreedChannel>> = {
  control: { id: 0, options: { ordered: false, maxRetransmits: 0 } },
  session: { id: 1, options: {} },
  stop: { id: 2, options: {} },
};

/** The offer to be posted; the browser's own stays as it was made. */
export function withChannels(sdp: string): string {
  const [head = "", ...sections] = sdp.split(/^(?=m=)/m);
  const lines = Object.entries(AGREED_CHANNELS).map(([label, { id, options }]) => {
    const lossy = options.ordered === false ? `;ordered=false;max-retr=${options.maxRetransmits ?? 0}` : "";
    return `a=dcmap:${id} label="${label}"${lossy}\r\n`;
  });
  const named = sections.map((each) => (each.startsWith("m=application") ? each + lines.join("") : each));
  return head + named.join("");
}
