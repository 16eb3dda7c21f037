/* Part of the compiled kernel: the hash of the source that it was made from, for tests. */
#define TEXT(macro) #macro
#define VALUE(macro) TEXT(macro)
const char kernel_source[] = VALUE(KERNEL_SOURCE);
