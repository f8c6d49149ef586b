// A file in the hands of the reader.

/** A name that every system takes for a file. */
export function fileName(name, ending) {
  const plain = name.replace(/[^A-Za-z0-9_.+-]+/g, "-").replace(/^[-.]+|[-.]+$/g, "");
  return `${plain.slice(0, 80) || "chart"}.${ending}`;
}

/** Hand a file to the reader; `address` is that of data, or of a blob. */
export function saveAs(address, name) {
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
}

/** The same, of a blob. */
export function saveBlob(blob, name) {
  const address = URL.createObjectURL(blob);
  saveAs(address, name);
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}
