import { expect, test } from "vitest";
import { withChannels } from "../../../src/transport/webrtc/data_channels";

const CHANNELS = [
  'a=dcmap:0 label="control";ordered=false;max-retr=0\r\n',
  'a=dcmap:1 label="session"\r\n',
  'a=dcmap:2 label="stop"\r\n',
].join("");

test("the section of the data channels names all of them, wherever it stands", () => {
  const video = "m=video 9 UDP/TLS/RTP/SAVPF 96\r\na=mid:0\r\n";
  const data = "m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\na=sctp-port:5000\r\n";
  expect(withChannels(`v=0\r\n${video}${data}`)).toBe(`v=0\r\n${video}${data}${CHANNELS}`);
  expect(withChannels(`v=0\r\n${data}${video}`)).toBe(`v=0\r\n${data}${CHANNELS}${video}`);
});

test("an offer without data channels stays as it is", () => {
  expect(withChannels("v=0\r\nm=audio 9 RTP/AVP 0\r\n")).toBe("v=0\r\nm=audio 9 RTP/AVP 0\r\n");
});
