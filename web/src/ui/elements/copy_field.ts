import { button, h, setText } from "./dom";

const TOLD_MS = 2500;

/** A text that is there to be copied. */
export function createCopyField(
  label: string,
  copied = "The link is copied",
): { element: HTMLElement; show(text: string): void } {
  const field = h("input", "field copy-text", { type: "text", readonly: "", "aria-label": label });
  const copy = button("field-button", "Copy", () => void copyText());
  const told = h("span", "copy-told", { role: "status" });
  field.addEventListener("focus", () => field.select());
  let timer: ReturnType<typeof setTimeout> | undefined;

  const tell = (button: string, words: string): void => {
    setText(copy, button);
    setText(told, words);
    clearTimeout(timer);
    timer = setTimeout(() => {
      setText(copy, "Copy");
      setText(told, "");
    }, TOLD_MS);
  };
  const copyText = async (): Promise<void> => {
    if (await written(field)) tell("Copied", copied);
    else {
      field.focus();
      tell("Copy", "This browser does not let the page copy: the text is selected, press Ctrl C");
    }
  };
  return {
    element: h("div", "copy", {}, h("div", "copy-line", {}, field, copy), told),
    show(text) {
      field.value = text;
      setText(copy, "Copy");
      setText(told, "");
    },
  };
}

/** Only secure pages have a clipboard; on others the old way may still do. */
async function written(field: HTMLInputElement): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(field.value);
    return true;
  } catch {
    field.select();
    // eslint-disable-next-line @typescript-eslint/no-deprecated -- nothing else copies on a page without TLS
    return document.execCommand("copy");
  }
}
