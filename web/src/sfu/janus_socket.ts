import { parseJanus, type JanusMessage } from "./janus_messages";

const ANSWER_MS = 8000;
const KEEPALIVE_MS = 25_000; // a Janus forgets a session after 60 s

/** One session with a Janus over its WebSocket, and its handle of the video room. It ends once. */
export class JanusSocket {
  private readonly socket: WebSocket;
  private readonly waiting = new Map<string, (message: JanusMessage | null) => void>();
  private readonly timer: ReturnType<typeof setInterval>;
  private session: number | undefined;
  private handle: number | undefined;
  private next = 1;

  constructor(
    url: string,
    private readonly ended: (why: string) => void,
  ) {
    this.socket = new WebSocket(url, "janus-protocol");
    this.socket.onmessage = (event: MessageEvent<unknown>) => this.received(parseJanus(event.data));
    this.socket.onclose = () => this.end("the connection to the relay was closed");
    this.timer = setInterval(() => this.post("keepalive", {}, `keep-${this.next++}`), KEEPALIVE_MS);
  }

  /** Raises Error when the relay refuses or does not answer. */
  async begin(): Promise<void> {
    await this.opened();
    this.session = numberOf(await this.ask("create", {}));
    this.handle = numberOf(await this.ask("attach", { plugin: "janus.plugin.videoroom" }));
  }

  /** A request to the video room; raises as `begin`. */
  async message(body: object, answer: string | null): Promise<JanusMessage> {
    return this.ask("message", answer === null ? { body } : { body, jsep: { type: "answer", sdp: answer } });
  }

  close(): void {
    clearInterval(this.timer);
    this.socket.onclose = null;
    this.socket.onmessage = null;
    this.socket.close();
    for (const answer of this.waiting.values()) answer(null);
  }

  private async opened(): Promise<void> {
    if (this.socket.readyState === WebSocket.OPEN) return;
    await new Promise<void>((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error("the relay does not answer")), ANSWER_MS);
      this.socket.onopen = () => {
        clearTimeout(timer);
        resolve();
      };
      this.socket.onerror = () => {
        clearTimeout(timer);
        reject(new Error("the relay cannot be reached"));
      };
    });
  }

  private async ask(kind: string, fields: object): Promise<JanusMessage> {
    const transaction = `page-${this.next++}`;
    const answer = await new Promise<JanusMessage | null>((resolve) => {
      const timer = setTimeout(() => resolve(null), ANSWER_MS);
      this.waiting.set(transaction, (message) => {
        clearTimeout(timer);
        resolve(message);
      });
      this.post(kind, fields, transaction);
    });
    this.waiting.delete(transaction);
    if (answer === null) throw new Error("the relay does not answer");
    if (answer.kind === "error") throw new Error(`the relay refused: ${answer.detail}`);
    return answer;
  }

  private post(kind: string, fields: object, transaction: string): void {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    const place = { session_id: this.session, handle_id: kind === "keepalive" ? undefined : this.handle };
    this.socket.send(JSON.stringify({ janus: kind, transaction, ...place, ...fields }));
  }

  private received(message: JanusMessage | null): void {
    if (message === null || message.kind === "ack") return;
    if (message.kind === "ended") this.end("the relay ended the subscription");
    else this.waiting.get(message.transaction)?.(message);
  }

  private end(why: string): void {
    clearInterval(this.timer);
    for (const answer of this.waiting.values()) answer(null);
    this.ended(why);
  }
}

function numberOf(message: JanusMessage): number {
  const id = message.data["id"];
  if (typeof id !== "number") throw new Error("the relay's answer has no id");
  return id;
}
