// What contacts remember from step to step: who pressed where and how hard, what is caught, how bodies leave each
// other.
#pragma once

#include <map>
#include <memory>

#include "meshless_surgery/base/archive.h"
#include "meshless_surgery/contact/contacts.h"

namespace meshless {

class ContactsMemory {
 public:
  ContactsMemory();
  ~ContactsMemory();
  ContactsMemory(ContactsMemory&&) noexcept;
  ContactsMemory& operator=(ContactsMemory&&) noexcept;
  ContactsMemory(const ContactsMemory&);
  ContactsMemory& operator=(const ContactsMemory&);

  struct KnownCollider {
    std::size_t triangles = 0;
  };
  /// For memory that was read from a file: why it does not fit these colliders (by key); empty where it does.
  std::string fault(const std::map<std::uint64_t, KnownCollider>& colliders) const;

 private:
  friend class Contacts;
  friend void save(OutArchive& archive, const ContactsMemory& memory);
  friend void save(HashArchive& archive, const ContactsMemory& memory);
  friend void load(InArchive& archive, ContactsMemory& memory);
  struct Data;
  std::unique_ptr<Data> data_;
};

void save(OutArchive& archive, const ContactsMemory& memory);
void save(HashArchive& archive, const ContactsMemory& memory);
void load(InArchive& archive, ContactsMemory& memory);

}  // namespace meshless
