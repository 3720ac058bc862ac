import { describe, expect, it, vi } from "vitest";
import { WhepSession, type WhepApi } from "../../../src/transport/signalling/whep_session";

const ANSWER = { sdp: "v=0", location: "/whep/1", tag: '"one"', servers: [{ urls: ["turn:here"] }] };
const LOCAL = "v=0\r\na=ice-ufrag:u\r\na=ice-pwd:p\r\nm=audio 9 X\r\na=mid:0\r\n";
const CANDIDATE = "a=candidate:1 1 udp 1 192.0.2.9 4000 typ host\r\n";
const RESTARTED = "a=ice-ufrag:new\r\na=ice-pwd:newer\r\n";

function fakeApi(fragment = RESTARTED) {
  return {
    end: vi.fn<WhepApi["end"]>(() => Promise.resolve()),
    media: vi.fn<WhepApi["media"]>(() => expect.unreachable()),
    offer: vi.fn<WhepApi["offer"]>(() => Promise.resolve(ANSWER)),
    restart: vi.fn<WhepApi["restart"]>(() => Promise.resolve({ fragment, tag: '"two"' })),
    trickle: vi.fn<WhepApi["trickle"]>(() => Promise.resolve()),
  };
}

function connection(gathering = "complete", local = LOCAL + CANDIDATE): RTCPeerConnection {
  const found = {
    iceGatheringState: gathering,
    localDescription: { sdp: local },
    remoteDescription: { sdp: "v=0\r\na=ice-ufrag:old\r\na=ice-pwd:older\r\n" },
  };
  return found as unknown as RTCPeerConnection;
}

async function begun(api: WhepApi): Promise<WhepSession> {
  const session = new WhepSession(api);
  await session.offer("v=0", "", new AbortController().signal);
  return session;
}

describe("a session at the console", () => {
  it("has the servers of its answer, and ends at its address", async () => {
    const api = fakeApi();
    const session = await begun(api);
    expect(session.servers).toEqual(ANSWER.servers);
    session.end(false);
    expect(api.end).toHaveBeenCalledWith("/whep/1");
  });

  it("is not ended again when the console has done so", async () => {
    const api = fakeApi();
    (await begun(api)).end(true);
    expect(api.end).not.toHaveBeenCalled();
  });

  it("goes on with no answer that comes after its end", async () => {
    const session = new WhepSession(fakeApi());
    const asked = session.offer("v=0", "", new AbortController().signal);
    session.end(false);
    await expect(asked).rejects.toMatchObject({ error: "closed" });
  });

  it("tells its candidates once all are gathered, and none after its end", async () => {
    const api = fakeApi();
    new WhepSession(api).trickle(connection());
    const session = await begun(api);
    session.trickle(connection("gathering"));
    session.trickle(connection("complete", LOCAL));
    expect(api.trickle).not.toHaveBeenCalled();
    session.trickle(connection());
    expect(api.trickle).toHaveBeenCalledWith("/whep/1", '"one"', expect.stringContaining("192.0.2.9"));
    session.end(true);
    session.trickle(connection());
    expect(api.trickle).toHaveBeenCalledTimes(1);
  });

  it("has another tag after a restart", async () => {
    const api = fakeApi();
    const session = await begun(api);
    expect(await session.restart(connection())).toContain("a=ice-ufrag:new");
    session.trickle(connection());
    expect(api.trickle).toHaveBeenCalledWith("/whep/1", '"two"', expect.anything());
  });

  it("refuses a restart without credentials", async () => {
    const session = await begun(fakeApi(""));
    await expect(session.restart(connection())).rejects.toMatchObject({ error: "malformed" });
  });
});
