// The part of a link behind #: what a page holds, compressed, in letters that an address takes.

const toBase64 = (bytes) => {
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
};
const fromBase64 = (text) =>
  Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (c) => c.charCodeAt(0));
const MOST_BYTES = 1_000_000;

/** Bytes that come out of a stream of compression. Throws RangeError for more than the largest request. */
async function through(bytes, stream) {
  const parts = [];
  let size = 0;
  for (const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader(); ;) {
    const { done, value } = await reader.read();
    if (done) return new Uint8Array(await new Blob(parts).arrayBuffer());
    parts.push(value);
    if ((size += value.length) > MOST_BYTES) {
      reader.cancel();
      throw new RangeError("larger than any request");
    }
  }
}

/** Return the content of a page, as plain values, as the fragment of a link, the part after #. */
export async function toFragment(content) {
  const bytes = new TextEncoder().encode(JSON.stringify(content));
  if (typeof CompressionStream === "undefined") return `j=${toBase64(bytes)}`;
  return `z=${toBase64(await through(bytes, new CompressionStream("deflate-raw")))}`;
}

const fieldsOf = (host) => [...host.querySelectorAll("input:not([type=file]), select")].filter(({ id }) => id);

/** The entries of the fields within `host` that are not as the page begins, by their ids. */
export function entriesOf(host) {
  const changed = fieldsOf(host).flatMap((field) => {
    const { id, type, checked, defaultChecked, value, options, defaultValue } = field;
    if (type === "checkbox") return checked === defaultChecked ? [] : [[id, checked]];
    return value === (options ? options[0].value : defaultValue) ? [] : [[id, value]];
  });
  return Object.fromEntries(changed);
}

/** Enters such entries into the fields within `host`; fields that have none are as the page begins. */
export function enter(host, entries) {
  for (const field of fieldsOf(host)) {
    const { id, type, defaultChecked, options, defaultValue } = field,
      entry = entries?.[id],
      before = type === "checkbox" ? field.checked : field.value;
    if (type === "checkbox") field.checked = typeof entry === "boolean" ? entry : defaultChecked;
    else field.value = typeof entry === "string" ? entry : options ? options[0].value : defaultValue;
    if (before !== (type === "checkbox" ? field.checked : field.value))
      field.dispatchEvent(new Event("change", { bubbles: true }));
  }
}

/** Return the content of the fragment of a link; null if there is none. Throws Error if it is damaged. */
export async function fromFragment(fragment) {
  const [, kind, text] = /^#?([zj])=(.+)$/.exec(fragment) ?? [];
  if (!kind) return null;
  try {
    const bytes = fromBase64(text);
    return JSON.parse(
      new TextDecoder().decode(kind === "z" ? await through(bytes, new DecompressionStream("deflate-raw")) : bytes),
    );
  } catch (error) {
    throw new Error("The link is damaged and cannot be read. Copy the whole link again.", { cause: error });
  }
}
