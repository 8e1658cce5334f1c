// Whether a header that somebody else wrote declares every function of functions.h, with the same ABI.
// Compile with -DHEADER='"dhdc.h"'; what differs is an error that names the function.
#include HEADER

#include <type_traits>

template <class T> struct seen { using type = T; };
template <class T, decltype(sizeof 0) n> struct seen<T (*)[n]> { using type = T *; }; // double[3][3] is 9 doubles
template <class R, class... A> struct seen<R (*)(A...)> { using type = R (*)(typename seen<A>::type...); };

#define F(result, name, ...) \
    static_assert(std::is_same_v<seen<decltype(&name)>::type, result (*)(__VA_ARGS__)>, "differs: " #name);
#include "functions.h"
